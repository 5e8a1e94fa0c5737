"""What scripts ask of the whole sheet, and the figures that they draw of it."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from paper.errata import errata
from paper.models.reduction import LEAST_ATTENUATION, cells_named
from smoskin.mechanics.sheet.lattice import column_beam
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.origami.geometry import geometry

pytest.importorskip("jax")
pytest.importorskip("matplotlib")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def computed(planar) -> SimpleNamespace:
    from paper.beyond.attenuation_fit import assumptions
    from paper.beyond.displacement_field import press_field
    from paper.figure_s9 import recovery
    from paper.figure_s15 import warmth
    from paper.figure_s16 import covers

    return SimpleNamespace(
        recovery=recovery(planar),
        warmth=warmth(planar),
        covers=covers(planar),
        field=press_field(planar),
        assumptions=assumptions(planar),
    )


def texts(figure) -> str:
    """All that is written on a figure."""
    return "\n".join(
        artist.get_text() for artist in figure.findobj(lambda a: hasattr(a, "get_text"))
    )


# The reduced model against the whole sheet


def test_granting_the_assumptions_brings_the_reduced_model_nearer(computed):
    built, guided, touching, sheared, hard, rigid = computed.assumptions.variants
    left = [variant.columns.residual for variant in (sheared, touching, guided, hard, rigid)]
    assert left == sorted(left, reverse=True)
    assert left[0] > 0.5
    assert left[-1] < 0.06
    assert [variant.cells_agreeing for variant in (built, guided, hard, rigid)] == [36, 35, 36, 36]
    assert (built.named, guided.named) == (34, 32)
    assert sheared.cells_agreeing < touching.cells_agreeing < 35
    assert sheared.named < touching.named < guided.named
    for variant in computed.assumptions.variants:
        assert variant.columns.residual <= variant.unscaled.residual + 1e-9
        assert variant.columns.residual <= 1.0
        assert variant.unscaled.scale == 1.0


def test_creases_and_panels_take_little_of_a_press(computed):
    """As the SI claims under S25; what it leaves out takes most."""
    energy = computed.assumptions.energy
    assert sum(energy) == pytest.approx(1.0)
    assert energy.creases < 0.01 < energy.sway < energy.panels < 0.2 < 0.5 < energy.sink


def test_folding_grows_with_axial_stiffness_and_towards_one(computed):
    for folding in (computed.assumptions.folding, computed.assumptions.folding_sheared):
        assert (np.diff(folding) > 0).all()
        assert folding[-1] > 0.98
    assert (np.array(computed.assumptions.folding_sheared) < computed.assumptions.folding).all()
    as_built = computed.assumptions.variants[1].presses
    assert computed.assumptions.folding[0] == pytest.approx(as_built.folding.mean(), rel=1e-9)
    assert computed.assumptions.sizes[0].folding == pytest.approx(as_built.folding.mean(), rel=1e-9)


def test_the_errata_say_what_came_out(planar, computed):
    energies, entry = (
        next(erratum for erratum in errata(planar) if erratum.number == number)
        for number in ("U4", "U5")
    )
    built, guided, touching, sheared, hard, rigid = computed.assumptions.variants
    energy = computed.assumptions.energy

    def pair(fit, between=", "):
        return between.join(f"{v:.2f}" for v in fit.attenuation)

    def percent(share):
        return f"{100 * share:.0f} %"

    assert f"{percent(energy.panels)} is in panels and {100 * energy.creases:.1f} % in" in (
        energies.tried
    )
    assert f"{percent(energy.sway)} sideways, and {percent(energy.sink)} along z" in energies.tried
    stuck = " : ".join(f"{built.presses.stiffness[k, k] / 1e3:.2f}" for k in range(3))
    for text in (
        f"for {built.cells_agreeing} of 36 cells, and S12 names {built.named}",
        f"magnets' motion, {pair(built.magnets, ' and ')}",
        f"{percent(guided.presses.folding.mean())} of a press folds",
        f"v_a = {pair(built.columns)} leaves {percent(built.columns.residual)}",
        f"at {built.columns.scale:.2f} of its size",
        f"the stiffness {stuck} N/mm",
        f"0.23 names {cells_named(built.presses, planar.coefficients.attenuation)} cells",
    ):
        assert text in entry.holds, text
    assert built.stiffness.attenuation[0] < 2 * LEAST_ATTENUATION
    half = 10 ** np.interp(
        0.5, computed.assumptions.folding, np.log10(computed.assumptions.axial_factors)
    )
    for text in (
        f"{touching.cells_agreeing} of 36 signs and {touching.named} cells named",
        f"{sheared.cells_agreeing} and {sheared.named}, {percent(sheared.presses.folding.mean())}",
        f"v_a = {pair(hard.columns)} and {percent(hard.columns.residual)} left",
        f"procedure finds {hard.stiffness.attenuation[0]:.2f}",
        f"as well, {pair(rigid.columns)} and {percent(rigid.columns.residual)}",
        f"columns {half:.1f} times as stiff",
    ):
        assert text in entry.tried


def test_the_fit_is_drawn_with_its_numbers(computed):
    from paper.beyond.attenuation_fit import draw

    plate = draw(computed.assumptions)
    written = texts(plate.figure)
    for variant in computed.assumptions.variants:
        assert "{:.2f}, {:.2f}".format(*variant.columns.attenuation) in written
        assert f"{variant.cells_agreeing} of 36" in written
    for k in (0, 3, 4):
        for left in computed.assumptions.variants[k].columns.cell_residual.ravel():
            assert f"{left:.2f}" in written
    assert "Not in the paper" in plate.caption


@pytest.mark.slow
def test_the_search_for_the_device_is_drawn_with_what_it_met(planar):
    from paper.beyond.device_search import draw
    from paper.models.device import Study
    from paper.models.observations import OBSERVATIONS

    study = Study.read()
    plate = draw(planar, study)
    written, nearest = texts(plate.figure), study.trials.nearest
    unmet = plate.caption.partition("Met by none: ")[2].partition(". (b)")[0].split("; ")
    for line, item in enumerate(OBSERVATIONS):
        assert item.name in written
        assert (item.name in unmet) == (nearest[line, line] > 1.0)
        assert f"{nearest[line].max():.1f}" in written
    assert f"meets {study.most_met} of {len(OBSERVATIONS)}, no design more" in plate.caption
    assert f"{study.tried} designs" in plate.caption


def test_the_errata_say_what_the_search_for_the_device_found(planar):
    from paper.models.device import Study, device
    from paper.models.observations import press_all
    from paper.models.reduction import fit_magnets, fit_stiffness

    study = Study.read()
    trials = study.trials
    shown = press_all(device(planar, trials.values[trials.best])).guided
    stiffness = shown.stiffness.diagonal()[:3] / shown.stiffness[0, 0]
    ratio = f"1 : {stiffness[1]:.2f} : {stiffness[2]:.2f}"
    motions = " and ".join(f"{v:.2f}" for v in fit_magnets(shown).attenuation)
    entry = next(erratum for erratum in errata(planar) if erratum.number == "U5")
    for text in (
        f"Of {study.tried} designs",
        f"more than {study.most_met} of {len(trials.nearest)} statements",
        f"{100 * shown.folding.mean():.0f} % folds, and its magnets' v_a is {motions}",
        f"stiffness {ratio} fits no v_a",
    ):
        assert text in entry.tried
    assert fit_stiffness(shown).attenuation[0] < 2 * LEAST_ATTENUATION
    assert (trials.misses[trials.best, :2] == 0.0).all()  # all signs, all names
    assert (np.flatnonzero(trials.nearest.diagonal() > 1.0) == [2, 3, 4, 8]).all()


# The displacement field


def test_the_columns_carry_the_press(planar, computed):
    field = computed.field
    feet = geometry(planar).sheet.columns
    sunk = -field.moved[feet, 2]
    # Columns that sway shorten besides.
    assert 0.5 < sunk.sum() * column_beam(planar).axial < 0.51
    assert field.plate < sunk.mean() < 1.02 * field.plate
    assert field.press < field.reduced_press
    assert np.abs(field.moved[feet][..., :2]).max() > 0.9 * np.abs(field.reduced).max()


def test_the_displacement_field_is_drawn_with_its_scales(planar, computed):
    from paper.beyond.displacement_field import draw

    plate = draw(planar, computed.field)
    whole, reduced, section = plate.figure.axes[:3]
    arrows = whole.collections[1]
    factor = float(whole.get_title(loc="left").rpartition("x ")[2])
    feet = geometry(planar).sheet.columns
    moved = computed.field.moved[feet][..., :2].reshape(-1, 2) * 1e3 * factor
    assert_allclose(np.stack([arrows.U, arrows.V], axis=-1), moved)
    assert float(reduced.get_title(loc="left").rpartition("x ")[2]) >= factor
    assert_allclose(section.lines[0].get_ydata(), -field_row(planar, computed.field) * 1e3)
    assert f"{computed.field.press * 1e3:.2f} mm at the pressed vertex" in plate.caption


def field_row(design, field):
    """Motion in z of the vertices of the pressed row."""
    return field.moved[:, 2].reshape(2 * design.cells[0] + 1, -1)[:, 5]


# Figure S16


def test_covers_make_the_motion_independent_of_the_place(computed):
    bare, covered = computed.covers.bare, computed.covers.covered
    assert covered.spread.max() < 1e-9
    assert_allclose(
        covered.motion, np.broadcast_to(covered.table[:, :, None], covered.motion.shape),
        atol=1e-12,
    )  # fmt: skip
    assert (covered.recall == 1).all()
    assert bare.spread.min() > 0.03
    assert 0.5 < bare.recall.mean() <= covered.recall.mean()
    assert covered.place_error.mean() <= bare.place_error.mean()
    # The middle of the cell is never further than its corner places.
    assert covered.place_error.max() == pytest.approx(0.4 * np.hypot(20e-3, 26.667e-3), rel=1e-3)


def test_covers_are_drawn_with_their_spread(computed):
    from paper.figure_s16 import draw

    plate = draw(computed.covers)
    bare, covered, spread, errors = plate.figure.axes
    assert bare.get_xlim() == covered.get_xlim()
    written = {text.get_text() for text in spread.texts}
    for share, right in zip(
        computed.covers.bare.spread.ravel(), computed.covers.bare.recall.ravel(), strict=True
    ):
        assert f"{100 * share:.0f}\n({100 * right:.0f})" in written
    for line, coverage in zip(
        errors.lines, (computed.covers.bare, computed.covers.covered), strict=True
    ):
        assert line.get_xdata().mean() == pytest.approx(coverage.place_error.mean() * 1e3)
    assert "the paper prints no number" in plate.caption


# Figure S9


def test_recovery_is_the_rubbers_creep(planar, computed):
    recovery = computed.recovery
    prony = elastomer_prony(planar.columns.material)
    charged = prony.retardation_shares * -np.expm1(-10.0 / prony.retardation_times)

    def left(seconds):
        """Share of the settled motion that is left after 10 s of load."""
        return float(charged @ np.exp(-seconds / prony.retardation_times))

    loaded = left(0.0) + 1 - prony.retardation_shares.sum()
    after = recovery.times > 1e-4
    expected = np.array([left(t) for t in recovery.times[after]]) / loaded
    # The field is not quite in proportion to the motion.
    assert_allclose(recovery.left[:, after] / expected, 1.0, atol=0.15)
    for part, column in ((0.05, 1), (0.01, 2)):
        seconds = brentq(lambda t, part=part: left(t) / loaded - part, 0.0, 100.0)
        assert_allclose(recovery.settled[:, column], seconds, rtol=0.25)
    assert (recovery.settled[:, 0] == 0).all()
    assert recovery.cells == tuple((k, k) for k in range(1, 7))
    assert (recovery.signal.max(axis=1) > 100 * recovery.noise).all()


def test_recovery_is_drawn_cell_by_cell(computed):
    from paper.figure_s9 import draw

    plate = draw(computed.recovery)
    shown = (computed.recovery.times >= -2) & (computed.recovery.times <= 12)
    assert len(plate.figure.axes) == 6
    for k, axis in enumerate(plate.figure.axes):
        for s in range(2):
            assert_allclose(axis.lines[s].get_ydata(), computed.recovery.signal[k, shown, s] * 1e6)
        assert f"cell ({k + 1},{k + 1})" in axis.get_title(loc="left")
    assert "not in its text" in plate.caption
    assert "assumed" in plate.caption


# Figure S15


def test_all_three_components_fall_by_five_percent(computed):
    warmth = computed.warmth
    assert (np.abs(warmth.field[0]) > 4e-3).all()
    assert_allclose(warmth.loss, 0.05, rtol=2e-2)
    assert_allclose(warmth.read, warmth.field, atol=2e-5)
    assert_allclose(warmth.chip_temperature, warmth.temperature, atol=0.03)
    assert warmth.left < 2e-3
    assert warmth.left < 0.01 * np.abs(warmth.read[-1] / warmth.field[0] - 1).max()


def test_warmth_is_drawn_as_it_was_read(computed):
    from paper.figure_s15 import draw

    plate = draw(computed.warmth)
    fields, losses, rest = plate.figure.axes
    for k in range(3):
        read = np.abs(computed.warmth.read[:, k]) * 1e3
        assert_allclose(fields.lines[2 * k + 1].get_ydata(), read)
        assert f"{100 * computed.warmth.loss[k]:.2f} % per 10" in texts(losses)
        share = computed.warmth.corrected[:, k] / computed.warmth.field[0, k]
        assert_allclose(rest.lines[k].get_ydata(), 100 * (share - 1))
