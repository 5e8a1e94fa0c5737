"""Workshops that are none, and processes that ruin a skin or endanger its maker."""

from dataclasses import replace

import pytest

from smoskin.errors import DesignError
from smoskin.fabrication.workshop import Workshop, check_process, read_workshop


def test_acrylic_never_goes_into_the_hot_press(planar):
    shop = Workshop(bond="hot press")
    assert shop.adhesive == 0.0
    with pytest.raises(DesignError, match=r"320 degC.*got acrylic.*220 degC.*flammable"):
        check_process(planar, shop)
    check_process(replace(planar, panels=replace(planar.panels, material="polyimide")), shop)
    with pytest.raises(DesignError, match=r"rim_share must be 1: no part .* got 0.8"):
        check_process(replace(planar, columns=replace(planar.columns, rim_share=0.8)), shop)
    check_process(planar, Workshop())


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kerf": 2e-3}, r"workshop.kerf must be from 0 to 1 mm; got 2 mm"),
        ({"wall": 0.05e-3}, r"workshop.wall must be from 0.2 to 5 mm; got 0.05 mm"),
        ({"perforation": 1.2}, r"workshop.perforation must lie in \[0, 0.9\]; got 1.2"),
        ({"stock": (0.6, 0.01)}, r"workshop.stock .* got 600 x 10"),
    ],
)
def test_numbers_that_no_workshop_has_are_refused(values, message):
    with pytest.raises(DesignError, match=message):
        Workshop(**values)


def test_a_document_says_what_differs(tmp_path):
    path = tmp_path / "shop.toml"
    path.write_text('kerf_mm = 0.2\nbend = "sharp"\nstock_mm = [800.0, 500.0]\n')
    shop = read_workshop(path)
    assert shop == replace(Workshop(), kerf=0.2e-3, bend="sharp", stock=(0.8, 0.5))
    path.write_text("kerf = 0.2\n")
    with pytest.raises(DesignError, match=r"shop.toml: unknown key 'kerf'; did you mean 'kerf_mm'"):
        read_workshop(path)
