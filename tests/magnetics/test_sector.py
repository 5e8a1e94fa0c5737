"""The sector magnet's field against magpylib, brute force, physics and its own point charges."""

from dataclasses import replace
from itertools import pairwise

import magpylib
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.sector import VACUUM_PERMEABILITY, field, field_and_gradient

MAGNET = Magnet(name="M", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3, remanence=8.04e5)
SHAPES = [MAGNET, replace(MAGNET, height=0.2e-3), replace(MAGNET, radius=2e-3, height=9e-3)]
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def polarisation(magnet: Magnet) -> float:
    return VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity


def segments(magnet: Magnet, points: Floats) -> Floats:
    """The same magnet from four of magpylib's cylinder segments."""
    sources = []
    for sector in range(4):
        bisector = np.deg2rad(45.0 + 90.0 * sector)
        towards = -polarisation(magnet) * np.array([np.cos(bisector), np.sin(bisector), 0.0])
        sources.append(
            magpylib.magnet.CylinderSegment(
                dimension=(0.0, magnet.radius, magnet.height, 90 * sector, 90 * sector + 90),
                polarization=towards,
            )
        )
    with np.errstate(all="ignore"):
        return magpylib.getB(sources, points, sumup=True)


def brute_force(magnet: Magnet, point: Floats) -> Floats:
    """Adaptive quadrature of the line charges of all faces, one point, outside the magnet."""
    x, y, z = point / magnet.radius
    half = 0.5 * magnet.height / magnet.radius

    def line(dx: float, dy: float) -> Floats:
        square = dx * dx + dy * dy
        lower, upper = z + half, z - half
        r1, r2 = np.sqrt(square + lower**2), np.sqrt(square + upper**2)
        across = (lower / r1 - upper / r2) / square
        return np.array([dx * across, dy * across, 1.0 / r2 - 1.0 / r1])

    nearest = np.arctan2(y, x) % (2.0 * np.pi)
    total = np.zeros(3)
    for axis in range(3):
        for sector in range(4):
            start = 0.5 * np.pi * sector

            def curved(t: float, start: float = start, axis: int = axis) -> float:
                return -np.cos(t - start - 0.25 * np.pi) * line(x - np.cos(t), y - np.sin(t))[axis]

            cuts = [start, start + 0.5 * np.pi]
            if cuts[0] < nearest < cuts[1]:
                cuts.insert(1, nearest)
            total[axis] += sum(
                quad(curved, low, high, epsabs=1e-12, epsrel=1e-11, limit=400)[0]
                for low, high in pairwise(cuts)
            )
        for turned in (False, True):

            def plane(t: float, turned: bool = turned, axis: int = axis) -> float:
                return line(x, y - t)[axis] if turned else line(x - t, y)[axis]

            cuts = sorted({-1.0, 1.0, float(np.clip(y if turned else x, -1.0, 1.0))})
            total[axis] += np.sqrt(2.0) * sum(
                quad(plane, low, high, epsabs=1e-12, epsrel=1e-11, limit=400)[0]
                for low, high in pairwise(cuts)
            )
    return polarisation(magnet) / (4.0 * np.pi) * total


def outside(magnet: Magnet, count: int, rng: np.random.Generator) -> Floats:
    """Points round the magnet: anywhere, at a sensor, and 1e-6 to 0.1 radii off every surface."""
    half = 0.5 * magnet.height / magnet.radius
    part = count // 5
    anywhere = rng.uniform(-3.0, 3.0, (2 * part, 3))
    sensor = rng.uniform([-0.5, -0.5, -half - 1.8], [0.5, 0.5, -half - 0.6], (part, 3))
    off = 10.0 ** rng.uniform(-6.0, -1.0, part)
    turn = rng.uniform(0.0, 2.0 * np.pi, part)
    beside = np.stack(
        [
            (1.0 + off) * np.cos(turn),
            (1.0 + off) * np.sin(turn),
            rng.uniform(-half, half, part),
        ],
        axis=1,
    )
    out = np.sqrt(rng.uniform(0.0, 1.0, part))
    over = np.stack(
        [out * np.cos(turn), out * np.sin(turn), (half + off) * rng.choice([-1.0, 1.0], part)],
        axis=1,
    )
    points = np.concatenate([anywhere, sensor, beside, over])
    inside = (np.hypot(points[:, 0], points[:, 1]) <= 1.0) & (np.abs(points[:, 2]) <= half)
    points[inside, 2] += np.sign(points[inside, 2]) * 2.0 * half
    return points * magnet.radius


def clear_of_charge(magnet: Magnet, count: int, rng: np.random.Generator) -> Floats:
    """Points in and round the magnet, 0.03 radii or more off its surfaces and planes."""
    points = rng.uniform(-2.0, 2.0, (count, 3)) * magnet.radius
    least = 0.03 * magnet.radius
    kept = np.abs(np.hypot(points[:, 0], points[:, 1]) - magnet.radius) > least
    kept &= np.abs(np.abs(points[:, 2]) - 0.5 * magnet.height) > least
    kept &= np.abs(points[:, :2]).min(axis=1) > least
    return points[kept]


def relative(estimate: Floats, true: Floats) -> Floats:
    axes = tuple(range(1, true.ndim))
    return np.sqrt(np.sum((estimate - true) ** 2, axis=axes) / np.sum(true**2, axis=axes))


def test_agrees_with_magpylib_at_ten_thousand_points() -> None:
    points = outside(MAGNET, 10_000, np.random.default_rng(1))
    oracle = segments(MAGNET, points)
    error = relative(field(MAGNET, points), oracle)
    apart = ~(error < 1e-6)
    # magpylib itself loses digits near the axis and on some edges; there brute force decides.
    assert apart.mean() < 2e-3
    for point in points[apart]:
        assert_allclose(field(MAGNET, point), brute_force(MAGNET, point), rtol=0, atol=2e-8)


@pytest.mark.parametrize("magnet", SHAPES[1:], ids=["film", "rod"])
def test_agrees_with_magpylib_for_other_shapes(magnet: Magnet) -> None:
    points = outside(magnet, 1000, np.random.default_rng(2))
    error = relative(field(magnet, points), segments(magnet, points))
    assert np.quantile(error, 0.99) < 1e-6


def test_agrees_with_brute_force() -> None:
    for point in ([0.4e-3, -0.7e-3, -4e-3], [5.2e-3, 1e-3, 0.3e-3], [3e-3, 0.0, 1.001e-3]):
        point = np.array(point)
        assert relative(field(MAGNET, point)[None], brute_force(MAGNET, point)[None])[0] < 1e-8


def test_holds_inside_the_magnet() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform([-3e-3, -3e-3, -0.9e-3], [3e-3, 3e-3, 0.9e-3], (300, 3))
    assert relative(field(MAGNET, points), segments(MAGNET, points)).max() < 1e-6


@pytest.mark.parametrize("magnet", SHAPES, ids=["disc", "film", "rod"])
def test_gradient_is_the_slope_of_the_field_and_free_of_source(magnet: Magnet) -> None:
    points = clear_of_charge(magnet, 2000, np.random.default_rng(4))
    h = 2e-4 * magnet.radius
    steps = h * np.eye(3)
    slope = np.stack(
        [
            (
                8.0 * (field(magnet, points + step) - field(magnet, points - step))
                - (field(magnet, points + 2 * step) - field(magnet, points - 2 * step))
            )
            / (12.0 * h)
            for step in steps
        ],
        axis=-1,
    )
    size = np.linalg.norm(slope, axis=(1, 2))
    assert_allclose(np.trace(slope, axis1=1, axis2=2) / size, 0.0, atol=1e-5)  # div B = 0
    assert_allclose((slope - slope.swapaxes(1, 2)) / size[:, None, None], 0.0, atol=1e-5)  # curl
    density, gradient = field_and_gradient(magnet, points)
    assert_allclose(density, field(magnet, points), rtol=1e-13)
    assert relative(gradient, slope).max() < 1e-5


def test_near_gradient_is_smooth_up_to_the_curved_face() -> None:
    off = np.logspace(-8, -3, 60)
    turn = 0.3
    points = (1.0 + off)[:, None] * np.array([np.cos(turn), np.sin(turn), 0.04])
    _, gradient = field_and_gradient(MAGNET, 5e-3 * points)
    assert relative(gradient, np.broadcast_to(gradient[0], gradient.shape))[:30].max() < 1e-4


def test_a_quarter_turn_of_the_point_turns_the_field() -> None:
    points = outside(MAGNET, 500, np.random.default_rng(5))
    density, gradient = field_and_gradient(MAGNET, points)
    turned, turned_gradient = field_and_gradient(MAGNET, points @ QUARTER.T)
    assert_allclose(turned, density @ QUARTER.T, rtol=1e-12, atol=1e-15)
    assert_allclose(turned_gradient, QUARTER @ gradient @ QUARTER.T, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, -1, 1), (1, 1, -1)])
def test_a_mirrored_point_sees_the_mirrored_field(mirror: tuple[int, int, int]) -> None:
    points = outside(MAGNET, 500, np.random.default_rng(6))
    assert_allclose(field(MAGNET, points * mirror), field(MAGNET, points) * mirror, rtol=1e-12)


def test_scale_polarity_and_remanence() -> None:
    points = outside(MAGNET, 500, np.random.default_rng(7))
    density, gradient = field_and_gradient(MAGNET, points)
    larger = replace(MAGNET, radius=3 * MAGNET.radius, height=3 * MAGNET.height)
    same, shallower = field_and_gradient(larger, 3.0 * points)
    assert_allclose(same, density, rtol=1e-6)
    assert_allclose(3.0 * shallower, gradient, rtol=1e-5, atol=1e-4)
    assert_allclose(field(replace(MAGNET, polarity=-1), points), -density)
    assert_allclose(field(replace(MAGNET, remanence=4.02e5), points), 0.5 * density)


def test_towards_the_centre_means_field_away_from_the_face_on_the_axis() -> None:
    above = field(MAGNET, [0.0, 0.0, 4e-3])
    assert above[2] > 0.0
    assert_allclose(above[:2], 0.0)


def test_far_away_it_is_a_quadrupole() -> None:
    direction = np.array([0.3, 0.5, 0.8])
    for distance in (0.3, 1.0, 5.0):
        near, far = field(MAGNET, np.stack([distance * direction, 2.0 * distance * direction]))
        assert_allclose(near / far, 16.0, rtol=2e-3)


def test_surfaces_keep_the_normal_component_and_jump_by_the_magnetisation() -> None:
    turn = np.array([0.2, 0.9, 2.3])
    normal = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    place = 5e-3 * normal + [0.0, 0.0, 0.2e-3]
    jump = field(MAGNET, place - 1e-10 * normal) - field(MAGNET, place + 1e-10 * normal)
    assert_allclose(np.sum(jump * normal, axis=1), 0.0, atol=1e-5)
    sector = np.sign(normal) / np.sqrt(2.0)
    magnetised = -polarisation(MAGNET) * sector
    tangential = magnetised - np.sum(magnetised * normal, axis=1, keepdims=True) * normal
    assert_allclose(jump, tangential, atol=1e-5)
    on, just_off = field(MAGNET, place), field(MAGNET, place + 1e-11 * normal)
    assert_allclose(on, just_off, atol=1e-6)


def test_degenerate_places_are_finite_and_symmetric() -> None:
    r, c = MAGNET.radius, 0.5 * MAGNET.height
    points = np.array(
        [
            [0, 0, 0],
            [0, 0, c],
            [0, 0, 2 * c],
            [r, 0, 0],
            [r, 0, c],
            [0, -r, c],
            [r, 0, 3 * c],
            [r / 2, 0, c],
            [r / 2, 0, 0],
            [2 * r, 0, c],
            [2 * r, 0, 0],
            [0, 2 * r, -c],
            [r * np.sqrt(0.5), r * np.sqrt(0.5), c],
            [r / 3, r / 3, c],
            [0, 0, 1.0],
            [1e6, 0, 0],
        ]
    )
    density, gradient = field_and_gradient(MAGNET, points)
    assert np.isfinite(density).all()
    assert np.isfinite(gradient).all()
    on_plane = points[:, 1] == 0.0
    assert_allclose(density[on_plane, 1], 0.0)
    assert_allclose(gradient[on_plane][:, [0, 1, 1, 2], [1, 0, 2, 1]], 0.0)


def test_batches_keep_their_shape_and_nan_stays_nan() -> None:
    points = outside(MAGNET, 60, np.random.default_rng(8)).reshape(3, 4, 5, 3)
    density, gradient = field_and_gradient(MAGNET, points)
    assert density.shape == (3, 4, 5, 3)
    assert gradient.shape == (3, 4, 5, 3, 3)
    assert_allclose(density[1, 2, 3], field(MAGNET, points[1, 2, 3]), rtol=1e-13)
    assert field(MAGNET, np.empty((0, 3))).shape == (0, 3)
    mixed = field(MAGNET, [[np.nan, 0.0, 0.0], [0.0, np.inf, 0.0], [0.0, 0.0, 5e-3]])
    assert np.isnan(mixed[:2]).all()
    assert np.isfinite(mixed[2]).all()


def test_refuses_points_of_the_wrong_shape() -> None:
    with pytest.raises(ArgumentError, match=r"points must have shape \(\.\.\., 3\); got \(2,\)"):
        field(MAGNET, [0.0, 1.0])


@pytest.mark.parametrize(
    ("gap", "field_error", "gradient_error"),
    [(3e-3, 8e-6, 8e-5), (4e-3, 2.2e-6, 1.3e-5), (6e-3, 7e-7, 2e-6), (8e-3, 3e-7, 7e-7)],
)
def test_point_charges_stand_for_the_magnet(
    gap: float, field_error: float, gradient_error: float
) -> None:
    watched = [MAGNET, replace(MAGNET, polarity=-1), replace(MAGNET, remanence=5e5)]
    positions, charges = point_charges(watched)
    assert_allclose(charges.sum(axis=-1), 0.0, atol=1e-18)
    rng = np.random.default_rng(9)
    points = rng.uniform([-2e-3, -2e-3, -1.1e-3 - gap], [2e-3, 2e-3, -1e-3 - gap], (400, 3, 3))
    density, gradient = charge_field_and_gradient(positions, charges, points)
    for s, magnet in enumerate(watched):
        true, slope = field_and_gradient(magnet, points[:, s])
        assert relative(density[:, s], true).max() < field_error
        assert relative(gradient[:, s], slope).max() < gradient_error


def test_point_charges_take_one_reading_or_many() -> None:
    positions, charges = point_charges([MAGNET, MAGNET])
    points = np.full((7, 2, 3), -5e-3)
    density, gradient = charge_field_and_gradient(positions, charges, points)
    single, slope = charge_field_and_gradient(positions, charges, points[0])
    assert density.shape == (7, 2, 3)
    assert gradient.shape == (7, 2, 3, 3)
    assert_allclose(density[4], single)
    assert_allclose(gradient[4], slope)
    with pytest.raises(ArgumentError, match="magnets must name at least one magnet"):
        point_charges([])
