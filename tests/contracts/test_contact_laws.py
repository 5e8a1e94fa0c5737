"""What every contact law must do, whoever wrote it; and what is refused of those that do not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.errors import ArgumentError, ContractError, SmoskinError
from smoskin.mechanics.sheet.contact import (
    Bilinear,
    CoverPanels,
    ScaleContact,
    contact_of,
    shares_by,
    slopes_by,
)
from smoskin.mechanics.sheet.touches import (
    Covered,
    Sticking,
    Touches,
    cover_shares,
    patch_shares,
)
from smoskin.origami.geometry import geometry
from smoskin.roles import ContactLaw
from smoskin.twin.world.strangers import STRANGERS

LAWS: dict[str, Callable[[], ContactLaw]] = {
    "Bilinear": Bilinear,
    "CoverPanels": CoverPanels,
    "ScaleContact": ScaleContact,
} | {name: (lambda law=law: law) for name, law in STRANGERS.items()}


@pytest.fixture(params=LAWS)
def law(request) -> ContactLaw:
    return LAWS[request.param]()


@pytest.fixture(scope="module")
def touches(planar) -> Touches:
    """All over the skin, rims and corners included; one place in four without a touch."""
    rng = np.random.default_rng(7)
    extent = geometry(planar).extent
    position = rng.uniform(0.0, extent, (30, 2, 2))
    position[:4, 0] = [[0.0, 0.0], extent, [0.0, extent[1]], [extent[0] / 2, 0.0]]
    force = np.concatenate(
        [rng.uniform(-0.3, 0.3, (30, 2, 2)), -rng.uniform(0.1, 1, (30, 2, 1))], -1
    )
    force[1::2, 1] = 0.0
    return Touches(position=position, force=force, radius=rng.uniform(1e-3, 8e-3, (30, 2)))


def test_it_shares_every_touch_out_whole(law, planar, touches):
    shares = shares_by(law, planar, touches)
    assert shares.shape == (30, 2, 6, 6)
    assert np.isfinite(shares).all()
    assert_allclose(shares[touches.pressed].sum(axis=(1, 2)), 1.0, atol=1e-9)


def test_its_answer_to_a_touch_is_the_same_among_others(law, planar, touches):
    rows = [3, 17]
    some = Touches(
        position=touches.position[rows, :1], force=touches.force[rows, :1],
        radius=touches.radius[rows, :1],
    )  # fmt: skip
    every = law.shares(planar, touches)[rows, :1]
    assert_allclose(law.shares(planar, some), every, atol=1e-12)


def test_its_slopes_are_those_of_its_shares(law, planar):
    rng = np.random.default_rng(8)
    where = rng.uniform([0.002, 0.002], [0.018, 0.024], (60, 1, 2))
    press = Touches(position=where, force=np.broadcast_to([0.1, 0.0, -0.5], (60, 1, 3)))
    by_place, by_force = slopes_by(law, planar, press)
    assert by_place.shape == (60, 1, 2, 6, 6)
    assert by_force.shape == (60, 1, 3, 6, 6)
    for axis, step in enumerate(2e-7 * np.eye(2)):
        more, less = (law.shares(planar, replace(press, position=where + s)) for s in (step, -step))
        # Shares may bend at lines between vertices: most places lie on none.
        off = np.abs((more - less) / 4e-7 - by_place[:, :, axis]).max(axis=(1, 2, 3))
        assert np.median(off) < 0.05
    for axis, step in enumerate(1e-5 * np.eye(3)):
        more, less = (law.shares(planar, replace(press, force=press.force + s))
                      for s in (step, -step))  # fmt: skip
        off = np.abs((more - less) / 2e-5 - by_force[:, :, axis]).max(axis=(1, 2, 3))
        assert np.median(off) < 0.05


def test_it_weighs_along_a_single_row(law, planar):
    row = replace(planar, cells=(1, 6), magnets=(replace(planar.magnets[0], corner=(0, 3)),),
                  halls=planar.halls[:1])  # fmt: skip
    touch = Touches(position=[[(0.004, 0.08)]], force=[[(0.0, 0.0, -0.5)]])
    assert shares_by(law, row, touch).sum() == pytest.approx(1.0)


def test_the_usual_laws_are_the_functions_that_they_were(planar, touches):
    assert_array_equal(Bilinear().shares(planar, touches), patch_shares(planar, touches))
    assert_array_equal(CoverPanels().shares(planar, touches), cover_shares(planar, touches))
    assert contact_of(Covered()) == CoverPanels()
    assert contact_of(Sticking()) == Bilinear()


class Garbage(ContactLaw):
    """A law that answers whatever it is given."""

    def __init__(self, answer) -> None:
        self.answer = answer

    def shares(self, design, touches):
        whole = patch_shares(design, touches)
        return self.answer(whole) if callable(self.answer) else self.answer


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda s: s * 0.9, r"Garbage\.shares must be finite with the sum 1 .* got the sum 0\.9"),
        (lambda s: s * np.nan, r"Garbage\.shares must be finite .* got the sum nan at \("),
        (lambda s: s.astype(object) * 1j, r"Garbage\.shares must be an array of numbers"),
        (lambda s: s[:, 0], r"Garbage\.shares must have shape \(30, 2, 6, 6\); got \(30, 6, 6\)"),
        (lambda s: np.swapaxes(s, 0, 1), r"must have shape \(30, 2, 6, 6\); got \(2, 30, 6, 6\)"),
        (None, r"Garbage\.shares must have shape \(30, 2, 6, 6\); got \(\)"),
        ("much", r"Garbage\.shares must be an array of numbers; got 'much'"),
    ],
)
def test_garbage_is_refused_by_a_sentence_that_names_the_law(planar, touches, answer, message):
    with pytest.raises(ContractError, match=message) as caught:
        shares_by(Garbage(answer), planar, touches)
    assert isinstance(caught.value, SmoskinError)
    assert isinstance(caught.value, ValueError)


def test_slopes_of_another_shape_or_without_numbers_are_refused(planar, touches):
    class Steep(Garbage):
        def slopes(self, design, touches):
            return np.full((30, 2, 2, 6, 6), np.inf)

    with pytest.raises(ContractError, match=r"Steep\.slopes must be finite"):
        slopes_by(Steep(lambda s: s), planar, touches)
    Steep.slopes = lambda self, design, touches: np.zeros((30, 2, 6, 6))
    with pytest.raises(ContractError, match=r"Steep\.slopes must have shape \(30, 2, 2, 6, 6\)"):
        slopes_by(Steep(lambda s: s), planar, touches)


def test_what_is_no_law_is_refused(planar, touches):
    with pytest.raises(ContractError, match="contact must be a ContactLaw; got 'bilinear'"):
        shares_by("bilinear", planar, touches)


def test_a_law_that_knows_no_places_off_the_skin_is_not_asked_for_any(planar):
    off = Touches(position=[[(0.2, 0.0)]], force=[[(0.0, 0.0, -0.5)]])
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    with pytest.raises(ArgumentError, match="position must lie on the skin"):
        BarHinge(planar, contact=Garbage(lambda s: s)).press(off)


def test_the_sheet_and_the_twin_press_as_their_law_says(planar):
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge
    from smoskin.records import Contact
    from smoskin.twin.whole import Twin

    class Whole(ContactLaw):
        """All to the vertex of the first cell."""

        def shares(self, design, touches):
            shares = np.zeros((*touches.pressed.shape, *design.cells))
            shares[..., 0, 0] = 1.0
            return shares

    away = Touches(position=[[(0.1, 0.1)]], force=[[(0.0, 0.0, -0.3)]])
    there = Touches(position=[[geometry(planar).tops[0, 0]]], force=away.force, radius=1e-9)
    pressed = BarHinge(planar, contact=Whole()).press(away)
    asked = BarHinge(planar).press(there)
    assert_allclose(pressed.displacements, asked.displacements, atol=1e-10)
    contact = Contact(position=(0.1, 0.1), force=(0.0, 0.0, -0.3))
    twin = Twin(planar, seed=None, contact=Whole())
    moved = twin.motion([contact]).magnets
    assert np.abs(moved - Twin(planar, seed=None).motion([contact]).magnets).max() > 1e-5
    sunk = -pressed.displacements[0, geometry(planar).sheet.loaded[0, 0], 2]
    assert twin.depths([contact])[0] == pytest.approx(sunk, rel=1e-4)
    with pytest.raises(ContractError, match="Garbage"):
        Twin(planar, contact=Garbage(lambda s: 2 * s))


def test_derivatives_follow_a_law_that_feels_the_force(planar):
    """Against presses solved on either side."""
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    class Wide(ContactLaw):
        """A patch that grows with the force."""

        def shares(self, design, touches):
            wide = 2e-3 + 5e-3 * np.abs(touches.force[..., 2])
            return patch_shares(design, replace(touches, radius=wide))

    # On a vertex' lines, where shares feel the patch's radius.
    place = geometry(planar).tops[2, 2] + [0.3e-3, 0.2e-3]
    sheet = BarHinge(planar, contact=Wide())

    def pressed(force):
        touch = Touches(position=[[place]], force=[[(0.05, 0.0, -force)]])
        return sheet.press(touch, tolerance=1e-11).displacements[0], touch

    more, less = (pressed(0.5 + step)[0] for step in (1e-4, -1e-4))
    slopes = sheet.sensitivity(pressed(0.5)[1]).displacements[0, 0, 4]
    assert_allclose(-(more - less) / 2e-4, slopes, atol=2e-3 * np.abs(slopes).max())


def test_a_cover_that_spreads_nothing_is_bilinear(planar, touches):
    law = ScaleContact(spread=0.0, rim=1.0, patch=0.0, tilt=0.0)
    assert_allclose(law.shares(planar, touches), patch_shares(planar, touches), atol=1e-12)


@pytest.mark.parametrize(("patch", "spread"), [(1 / 3, 5e-3), (0.5, 0.0), (0.0, 2e-3)])
def test_a_cover_shares_as_a_disc_does_that_grows_with_the_press_and_the_rubber(
    planar, patch, spread
):
    rng = np.random.default_rng(4)
    force = np.concatenate([np.zeros((20, 1, 2)), -rng.uniform(0.1, 2, (20, 1, 1))], axis=-1)
    place = rng.uniform([0.04, 0.05], [0.07, 0.1], (20, 1, 2))  # away from the rim
    touches = Touches(position=place, force=force, radius=rng.uniform(1e-3, 6e-3, (20, 1)))
    squares = (touches.radius * (-force[..., 2]) ** patch) ** 2 + 4 * spread**2
    expected = patch_shares(planar, replace(touches, radius=np.sqrt(squares)))
    law = ScaleContact(patch=patch, spread=spread)
    assert_allclose(law.shares(planar, touches), expected, atol=1e-12)


def test_each_number_of_a_cover_does_what_it_says(planar):
    tops = geometry(planar).tops
    still = ScaleContact(spread=0.0, rim=1.0, patch=0.0, tilt=0.0)

    def of(law, place, force=(0.0, 0.0, -1.0), radius=1e-6):
        touches = Touches(position=[[place]], force=[[force]], radius=radius)
        shares = law.shares(planar, touches)[0, 0]
        middle = np.einsum("nm,nmd->d", shares, tops)
        return shares, middle

    # A lever of no length: past the rim the outermost vertices take it as on their line.
    level, middle = of(replace(still, rim=0.0), (0.0, tops[0, 2, 1]))
    assert level[0, 2] == pytest.approx(1.0, abs=1e-4)
    assert middle[0] == pytest.approx(tops[0, 0, 0], abs=1e-6)
    half = of(replace(still, rim=0.5), (0.0, tops[0, 2, 1]))[1]
    assert half[0] == pytest.approx(tops[0, 0, 0] / 2, abs=1e-6)
    # A drag of half the press leans by half the height, one beyond the press by all of it.
    leaning = replace(still, tilt=4e-3)
    for drag, moved in ((0.5, 2e-3), (3.0, 4e-3)):
        middle = of(leaning, (0.05, 0.08), (drag, 0.0, -1.0))[1]
        assert_allclose(middle, [0.05 + moved, 0.08], atol=1e-6)
    # On a vertex what spreads leaves it: more the wider the rubber, and the harder the press.
    shares = [of(replace(still, spread=s), tops[2, 2])[0][2, 2] for s in (0.0, 2e-3, 5e-3)]
    assert shares[0] > 0.999 > shares[1] > shares[2]
    growing = replace(still, patch=1 / 3)
    soft, hard = (of(growing, tops[2, 2], (0, 0, -f), 4e-3)[0][2, 2] for f in (0.1, 1.0))
    assert soft > hard


@pytest.mark.parametrize("name", ["spread", "rim", "patch", "tilt"])
def test_covers_that_cannot_be_are_refused(name):
    for wrong in (-1e-9, np.nan, np.inf):
        with pytest.raises(ArgumentError, match=f"{name} must be finite and >= 0; got {wrong}"):
            ScaleContact(**{name: wrong})
