"""A design begun from another one."""

import pytest

from smoskin.commands.new_design import new_design
from smoskin.design.document import parse_design
from smoskin.errors import ArgumentError
from smoskin.feasibility import check_design


def test_magnets_at_hand_decide_gaps_and_remanence():
    design = parse_design(new_design("weak", remanence=0.6))
    check_design(design)
    assert [round(1e3 * site.gap, 1) for site in design.halls] == [4.5, 4.4, 4.4]
    assert design.magnets[0].remanence == pytest.approx(0.6 / 1.25663706e-6)
    assert parse_design(new_design("strong")).halls[0].gap == pytest.approx(5.6e-3)


def test_what_is_no_magnet_is_no_design():
    with pytest.raises(ArgumentError, match="remanence must lie in"):
        new_design("none", remanence=0.0)
