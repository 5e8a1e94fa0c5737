"""The skin round a forearm in the hard world, by its shipped table, beside the planar skin."""

import numpy as np
import pytest

import smoskin as smo
from smoskin.commands.score.evaluate import HEADLINE
from smoskin.origami.cell import size

pytest.importorskip("jax")
SKINS = (101, 102)
"""Unseen made skins of either design; each is calibrated by 60 touches and pressed by 100."""


def sizes_of_errors(design):
    """Errors along x and y, m, and of force, N, of touches of 0.3 N and more, and shares held.

    A touch that is missed counts as one in the middle, without force.
    """
    sheet = smo.score(design.name, design, skins=SKINS, count=10, world="hard")
    assert sheet.exam.touches == 60
    assert sheet.sent_back == ()
    answers = sheet.cases[0].answers
    judged = answers.where(-answers.truth[:, 4] > HEADLINE - 1e-9)
    assert len(judged.truth) == len(SKINS) * 80
    middle = judged.truth[:, :2] - judged.extent / 2
    off = np.abs(np.where(judged.detected[:, None], judged.error[:, :2], middle)).mean(axis=0)
    return off, judged.force_error[:, 2].mean(), (judged.confidence((0, 1)) <= 0.9).mean()


@pytest.mark.slow
def test_a_skin_round_a_forearm_is_read_in_the_hard_world_as_the_planar_one_is(curved, planar):
    (along, across), force, held = sizes_of_errors(curved)
    assert along <= 1.2e-3
    assert across <= 2.0e-3
    assert force <= 0.04
    assert 0.80 <= held <= 0.99
    shares = [
        sizes / size(design.cell)[:2]
        for design, sizes in (
            (curved, np.array([along, across])),
            (planar, sizes_of_errors(planar)[0]),
        )
    ]
    assert (shares[0] <= 1.4 * shares[1]).all()
