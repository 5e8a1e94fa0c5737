"""Made skins of the tolerance table assemble and stay in range; worse workshops are noticed."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.fabrication.pattern.flat import crease_gaps
from smoskin.fabrication.process.tolerances import made_tolerances
from smoskin.fabrication.workshop import Workshop
from smoskin.twin.manufacture import drawn_skin

pytest.importorskip("jax")


@pytest.mark.slow
def test_95_of_100_made_skins_assemble_without_contact_and_stay_in_range(planar):
    from studies.made_skins import made_skin

    skins = [made_skin(planar, Workshop(), seed) for seed in range(200)]
    assert sum(skin.good for skin in skins) >= 190
    assert max(skin.range_share for skin in skins) < 0.95
    # Magnets a third stronger than the design's would leave the range of some.
    magnets = tuple(replace(m, remanence=1.4 * m.remanence) for m in planar.magnets)
    strong = [made_skin(replace(planar, magnets=magnets), Workshop(), seed) for seed in range(3)]
    assert not all(skin.good for skin in strong)


def test_gaps_without_their_spare_would_touch(planar):
    from studies.made_skins import clearances

    made = drawn_skin(planar, 1, made_tolerances(planar))
    usual = clearances(planar, Workshop(), made, np.random.default_rng(0))
    assert min(usual.values()) > 0
    bare = Workshop(kerf=0.0, crease_clearance=0.0)
    thick = replace(planar, creases=replace(planar.creases, gap=0.5e-3))
    assert min(crease_gaps(thick, bare)[1]) == 0.5e-3
    assert clearances(thick, bare, made, np.random.default_rng(0))["panels"] < 0
    tight = replace(planar, magnets=tuple(replace(m, play=0.1e-3) for m in planar.magnets))
    assert clearances(tight, Workshop(), made, np.random.default_rng(0))["holder"] < 0
