"""Stiffness of presses of any depth, and of a sheet that slides, against explicit springs."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from barhinge_oracle import Springs, hinge_gradient, press_stiffness
from paper.figure_s6 import column_multiplicity
from paper.models.finite_press import Columns, column_response, exact_change, motion_product
from paper.models.fold_energies import relative_crease_stiffness_map
from paper.models.stiffness_terms import (
    FIGURE_S7_ATTENUATIONS,
    normalised_stiffness_maps,
    sliding_stiffness_map,
    stiffness_terms,
)
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError
from smoskin.mechanics.reduced.attenuation import cell_change, column_displacements, profiles
from smoskin.mechanics.reduced.stiffness import (
    column_stiffness,
    relative_stiffness_map,
    stiffness_map,
)

FOLDS = ("length", "width", "mean")


def explicit_energy(cell, cells, attenuation, press, loaded, fold_from, exact):
    """Of springs of 1 N/m under explicit vertices: every cell says where its six feet go (S8-S11).

    Feet that cells share go where they say on average.
    """
    a, b, alpha, phi = cell.panel_a, cell.panel_b, cell.sector_angle, cell.fold_angle
    length, width = 2 * b * math.sin(phi), 2 * a * math.cos(alpha) / math.cos(phi)
    height = math.sqrt(a**2 - width**2 / 4)
    if exact:
        new_width = 2 * math.sqrt(a**2 - (height + press) ** 2)
        new_phi = math.acos(2 * a * math.cos(alpha) / new_width)
        grown = (2 * b * math.sin(new_phi) - length, new_width - width)
    else:
        dw = -4 * height / width * press  # (w/2)^2 + h^2 = a^2
        grown = (dw / width / math.tan(phi) ** 2 * length, dw)

    def zigzag(which: str, more: float) -> float:
        """Change of b cos(phi)."""
        if not exact:
            turn = (
                more / (2 * b * math.cos(phi))
                if which == "length"
                else (more / width / math.tan(phi))
            )
            return -b * math.sin(phi) * turn
        if which == "length":
            return math.sqrt(b**2 - (length + more) ** 2 / 4) - b * math.cos(phi)
        return b * (2 * a * math.cos(alpha) / (width + more) - math.cos(phi))

    def frame(here: int, there: int, v: float, more: float) -> float:
        """The cell's middle against the loaded one's: half of both and all between."""
        steps = abs(here - there)
        if steps == 0:
            return 0.0
        return math.copysign(
            more * (0.5 + sum(v**k for k in range(1, steps)) + v**steps / 2), here - there
        )

    moves = {}
    for n in range(cells[0]):
        for m in range(cells[1]):
            dl = grown[0] * attenuation[0] ** abs(n - loaded[0])
            dw = grown[1] * attenuation[1] ** abs(m - loaded[1])
            zig = {"length": zigzag("length", dl), "width": zigzag("width", dw)}
            zig["mean"] = (zig["length"] + zig["width"]) / 2
            x = frame(n, loaded[0], attenuation[0], grown[0])
            y = frame(m, loaded[1], attenuation[1], grown[1])
            for i in (-1, 0, 1):
                for j in (-1, 1):
                    foot = (2 * n + 1 + i, 2 * m + 1 + j)
                    bent = zig[fold_from] if i else 0.0
                    moves.setdefault(foot, []).append((x + i * dl / 2, y + j * dw / 2 + bent))
    return sum(0.5 * float((np.mean(by_cell, axis=0) ** 2).sum()) for by_cell in moves.values())


@pytest.mark.parametrize("fold_from", FOLDS)
@pytest.mark.parametrize(
    ("cells", "v"), [((4, 3), (0.3, 0.7)), ((1, 5), (1, 0.4)), ((3, 3), (1, 1))]
)
def test_column_energies_are_those_of_explicit_springs(planar, fold_from, cells, v):
    cell, k = planar.cell, column_stiffness(planar)
    skin = _resized(planar, cells)
    deep = column_response(skin, v, -1.1e-3, fold_from=fold_from)
    linear = column_response(skin, v, -1.1e-3, fold_from=fold_from, kinematics="first_order")
    relative = linear.stiffness / k
    if fold_from == "length":
        np.testing.assert_allclose(relative, relative_stiffness_map(cell, cells, v), rtol=1e-12)
    for n in range(cells[0]):
        for m in range(cells[1]):
            energy = explicit_energy(cell, cells, v, -1.0, (n, m), fold_from, exact=False)
            assert relative[n, m] == pytest.approx(2 * energy, rel=1e-9)
            energy = explicit_energy(cell, cells, v, -1.1e-3, (n, m), fold_from, exact=True)
            assert deep.energy[n, m] == pytest.approx(k * energy, rel=1e-9)
    np.testing.assert_allclose(linear.energy, k * relative * 1.1e-3**2 / 2, rtol=1e-12)
    np.testing.assert_allclose(linear.force, k * relative * 1.1e-3, rtol=1e-12)


def _resized(planar, cells):
    """The reference design of other numbers of cells; every magnet in a corner."""
    magnets = tuple(replace(magnet, corner=(0, 0)) for magnet in planar.magnets)
    return replace(planar, cells=cells, magnets=magnets)


@given(
    press=st.floats(-3e-3, 2e-3),
    v=st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 1.0)),
    fold_from=st.sampled_from(FOLDS),
)
def test_force_and_tangent_are_the_energys_derivatives(
    planar, assert_derivatives, press, v, fold_from
):
    assert_derivatives(lambda dh: column_response(planar, v, dh, fold_from=fold_from), press)


def test_at_rest_the_exact_response_is_the_linear_one(planar):
    v = planar.coefficients.attenuation
    rest = column_response(planar, v, 0.0)
    assert np.all(rest.energy == 0)
    assert np.all(rest.force == 0)
    expected = column_stiffness(planar) * relative_stiffness_map(planar.cell, planar.cells, v)
    np.testing.assert_allclose(rest.stiffness, expected, rtol=1e-12)


def test_pressed_deep_the_sheet_softens(planar):
    """The SI under S2: with both ratios falling as the sheet opens, the curve becomes flat."""
    v = planar.coefficients.attenuation
    tangents = [column_response(planar, v, -depth * 1e-3).stiffness for depth in (0, 1, 3, 6)]
    assert all(np.all(later < sooner) for sooner, later in itertools.pairwise(tangents))
    with pytest.raises(ArgumentError, match="press must leave the cell a height"):
        column_response(planar, v, -8e-3)


def columns(parts: Columns, load):
    """In-plane displacement of every column, (2N + 1, M + 1, 2), m."""
    n, m = load
    y = parts.y[m] + parts.zigzag_x[n][:, None]
    y[::2] += parts.zigzag_y[m]
    return np.stack([np.broadcast_to(parts.x[n][:, None], y.shape), y], axis=-1)


def random_columns(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(2, 3, 7)), rng.normal(size=(2, 4, 5))
    x[1, :, 1::2] = 0.0
    return Columns(x=x[0], y=y[0], zigzag_x=x[1], zigzag_y=y[1])


@given(seed=st.integers(0, 99), v=st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 1.0)))
def test_sums_over_columns_are_those_of_their_displacements(planar, seed, v):
    first, second = random_columns(seed), random_columns(100 + seed)
    product = motion_product(first, second)
    sliding = sliding_stiffness_map(planar.cell, (3, 4), v)
    parts = profiles(planar.cell, (3, 4), v, -1.0)
    for load in np.ndindex(3, 4):
        assert product[load] == pytest.approx(
            (columns(first, load) * columns(second, load)).sum(), abs=1e-12
        )
        u = column_displacements(parts, load)
        assert sliding[load] == pytest.approx(((u - u.mean(axis=(0, 1))) ** 2).sum(), rel=1e-9)


def test_first_order_is_the_limit_of_exact_with_rate_two(planar):
    def gap(press: float) -> float:
        first, exact = cell_change(planar.cell, press), exact_change(planar.cell, press)
        return abs(first.dl - exact.dl)

    rates = [np.log2(gap(-h) / gap(-h / 2)) for h in (1e-4, 5e-5, 2.5e-5)]
    np.testing.assert_allclose(rates, 2.0, atol=0.05)


def test_a_press_past_flat_is_refused(planar):
    with pytest.raises(ArgumentError, match="press must leave the cell a height"):
        exact_change(planar.cell, -0.02)


def ten_mm_cell() -> MiuraCell:
    return MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(45)
    )


#: 50 um of polyimide over 1 mm: printed to two digits it is the 0.026 N per rad of the ledger.
CREASE = 2.5e9 * 50e-6**3 / 12 / 1e-3


@pytest.mark.parametrize(("cells", "expected"), [((3, 3), 18.808), ((6, 6), 184.41)])
def test_a_rigid_sheet_is_as_stiff_as_its_bar_and_hinge_model(cells, expected):
    """One mechanism, free to slide: every cell is as stiff, and both programs agree."""
    cell, column = ten_mm_cell(), 63.0
    closed = column * sliding_stiffness_map(cell, cells, (1, 1))
    closed += CREASE * relative_crease_stiffness_map(cell, cells, (1, 1))
    digits = len(str(expected).partition(".")[2])
    np.testing.assert_allclose(closed / 1e3, expected, atol=0.5 * 10**-digits)
    springs = Springs(bar=1e8, panel=1e5, crease=CREASE, column=column)
    for load in ((cells[0] // 2, cells[1] // 2), (0, 0)):
        whole = press_stiffness(cell, cells, springs, load)
        assert whole == pytest.approx(closed[load], rel=1e-3)
        assert whole < closed[load] * (1 + 1e-9)  # the rigid sheet bounds it from above


def test_a_sheet_that_grips_is_stiffer(planar):
    for v in (0.3, 1.0):
        held, free = (
            stiffness(planar.cell, (6, 6), (v, v))
            for stiffness in (relative_stiffness_map, sliding_stiffness_map)
        )
        assert np.all(held >= free)
    rigid = sliding_stiffness_map(planar.cell, (6, 6), (1, 1))
    assert np.ptp(rigid) < 1e-9 * rigid.max()


def test_the_oracles_hinge_turns_with_its_angle():
    points = np.array([[0.0, 0, 0], [1, 0.2, 0], [0.3, 1, 0.4], [0.6, -0.9, 0.1]])
    gradient = hinge_gradient(points)

    def angle(p):
        axis = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
        left, right = np.cross(p[1] - p[0], p[2] - p[0]), np.cross(p[3] - p[0], p[1] - p[0])
        return math.atan2(np.cross(left, right) @ axis, left @ right)

    for node, axis in np.ndindex(4, 3):
        step = np.zeros((4, 3))
        step[node, axis] = 1e-6
        slope = (angle(points + step) - angle(points - step)) / 2e-6
        assert gradient[node, axis] == pytest.approx(-slope, abs=1e-8)


def test_figure_s7(planar):
    """The SI: at v_a = 1 the rim is far stiffer; that shrinks with v_a until the centre leads."""
    maps = normalised_stiffness_maps(planar.cell, (6, 6))
    assert maps.shape == (len(FIGURE_S7_ATTENUATIONS), 6, 6)
    np.testing.assert_allclose(maps.max(axis=(1, 2)), 1)
    ratio = maps[:, 0, 0] / maps[:, 2, 2]
    assert np.all(np.diff(ratio) < 0)
    assert ratio[0] > 2
    assert ratio[-1] < 1


@given(
    v=st.tuples(st.floats(0.05, 1.0), st.floats(0.05, 1.0)),
    fold_from=st.sampled_from(FOLDS),
    panel_energy=st.sampled_from(("neglected", "bending", "bending_and_stretching")),
)
def test_terms_add_up_and_none_is_negative(planar, v, fold_from, panel_energy):
    terms = stiffness_terms(planar, v, fold_from=fold_from, panel_energy=panel_energy)
    np.testing.assert_allclose(terms.total, terms.creases + terms.columns + terms.panels)
    for part in terms:
        assert np.all(part >= 0)
        # Swapping left and right swaps the map; the zigzag forbids the same along y.
        np.testing.assert_allclose(part, part[::-1], rtol=1e-9)
    with_coefficients = stiffness_map(planar, planar.coefficients)
    same = stiffness_terms(planar, planar.coefficients.attenuation).columns
    np.testing.assert_allclose(with_coefficients, same, rtol=1e-12)


@pytest.mark.parametrize("cells", [(1, 1), (2, 3), (5, 2)])
def test_columns_are_shared_by_the_cells_round_them(cells):
    count = np.zeros((2 * cells[0] + 1, cells[1] + 1))
    for n, m in np.ndindex(cells):
        count[2 * n : 2 * n + 3, m : m + 2] += 1
    np.testing.assert_array_equal(column_multiplicity(cells), count)
