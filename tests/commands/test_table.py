"""`smoskin table`: the table that it makes, and what it says of it."""

import json
from dataclasses import asdict, replace
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.commands.table import Effort, make_table
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.geometry import geometry
from smoskin.sensing.response.table import load_response_table
from tables_of_response import reduced_table


def run(*arguments):
    return CliRunner().invoke(app, [str(one) for one in arguments])


def test_a_table_is_made_with_the_effort_asked_for(planar, tmp_path, monkeypatch):
    asked = []

    def made(design, effort, progress):
        asked.append(effort)
        progress("pressing", 0.5)
        return reduced_table(design)

    monkeypatch.setattr("smoskin.commands.table.make_table", made)
    monkeypatch.chdir(tmp_path)
    result = run(
        "table", "planar", "--presses", "50", "--pairs", "0", "--skins", "3", "--seed", "2"
    )
    assert result.exit_code == 0, result.output
    assert asked == [replace(Effort(), presses=50, pairs=0, skins=3, seed=2)]
    assert "normal forces" in result.stdout
    assert load_response_table("planar.table").design_hash == planar.content_hash
    machines = run("table", "planar", "--out", tmp_path / "c.table", "--json")
    answer = json.loads(machines.stdout)
    assert answer["chips"] == [0, 1, 2]
    assert answer["file"] == str(tmp_path / "c.table")
    assert answer["modes"] == 0
    assert asked[-1] == Effort()
    assert (tmp_path / "c.table").exists()


class Bench:
    """Stands for twins, chips and fits: keeps what they are asked, answers with plain numbers."""

    def __init__(self, monkeypatch):
        self.pressed, self.fits, self.made = [], {}, []
        for name in ("fit_response_table", "add_coupling", "add_warmth", "add_modes"):
            monkeypatch.setattr(f"smoskin.commands.table.{name}", self.fit(name))
        for name in ("Twin", "Readout"):
            monkeypatch.setattr(f"smoskin.commands.table.{name}", getattr(self, name.lower()))
        monkeypatch.setattr("smoskin.commands.table.grip_compliance", lambda *parts: len(parts))
        monkeypatch.setattr(
            "smoskin.commands.table.made_mechanics", lambda design, deviations, t: (deviations, t)
        )
        monkeypatch.setattr(
            "smoskin.commands.table.draw", lambda design, rng, tolerances: rng.uniform(1, 2)
        )

    def fit(self, name):
        def keep(*given):
            self.fits[name] = given
            return self.table

        return keep

    def twin(self, design, *, seed, manufactured=False, tolerances=None):
        if manufactured:
            self.made.append((seed, tolerances))

        def motions(touches, temperature=REFERENCE_TEMPERATURE):
            self.pressed.append((seed, touches, temperature))
            size = np.full((len(touches.position), 3, 3), temperature + seed)
            return SimpleNamespace(size=size, valid=np.arange(len(size)) % 5 > 0)

        return SimpleNamespace(motions=motions, deviations=seed)

    def readout(self, design, made=1.0):
        return SimpleNamespace(risen=lambda motion: made * motion.size)


def test_a_table_is_made_of_the_presses_that_its_effort_names(planar, monkeypatch):
    bench = Bench(monkeypatch)
    bench.table = reduced_table(planar)
    effort = Effort(presses=4000, pairs=500, skins=3, draws=2, presses_a_skin=70, seed=4)
    told = []
    table = make_table(
        planar, effort, tolerances="t", progress=lambda task, share: told.append((task, share))
    )
    assert table.origin == {"smoskin": version("smoskin"), "effort": asdict(effort)}
    assert [task for task, _ in told] == ["the skin as designed", "pairs of touches",
                                          "warm and cold rubber", *["made skins"] * 3]  # fmt: skip
    assert [share for _, share in told] == pytest.approx(
        [0.0, 0.1, 0.2, 0.3, 0.3 + 0.7 / 3, 0.3 + 1.4 / 3]
    )
    # Presses all over the skin, two in five straight, the others dragged evenly over a disc.
    _, place, force, _ = bench.fits["fit_response_table"]
    extent = geometry(planar).extent
    assert place.shape == (4000, 2)
    assert place.min(axis=0) == pytest.approx([0, 0], abs=2e-4)
    assert place.max(axis=0) == pytest.approx(extent, abs=2e-4)
    assert (force[:, 2].min(), force[:, 2].max()) == pytest.approx((-1.15, -0.05), abs=2e-3)
    drag = np.hypot(force[:, 0], force[:, 1])
    assert (drag == 0).mean() == pytest.approx(0.4, abs=0.03)
    assert drag.max() == pytest.approx(0.6, abs=2e-3)
    assert np.mean(drag[drag > 0] ** 2) == pytest.approx(0.6**2 / 2, rel=0.05)
    assert np.abs(force[:, :2].mean(axis=0)).max() < 0.03
    # Pairs that found an equilibrium, straight and more than a cell apart.
    _, grip, place, force, both = bench.fits["add_coupling"]
    assert grip == 1
    assert place.shape == (400, 2, 2)
    assert both.shape == (400, 3, 3)
    assert not force[..., :2].any()
    assert (force[..., 2].min(), force[..., 2].max()) == pytest.approx((-1.15, -0.05), abs=0.02)
    cell = geometry(planar).cell
    apart = np.hypot(*(place[:, 0] - place[:, 1]).T).min()
    assert apart == pytest.approx(max(cell.length, cell.width), rel=0.05)
    assert apart >= max(cell.length, cell.width)
    # A degree's share of the step from ten below to ten above the reference.
    _, place, force, per_degree = bench.fits["add_warmth"]
    assert place.shape == (70, 2)
    assert force.shape == (70, 3)
    np.testing.assert_allclose(per_degree, 1.0)
    # The same presses on every made skin, each read by two draws of chips and magnets.
    assert bench.made == [(5_000_000 + k, "t") for k in range(3)]
    assert all((one[1].force[:, 0] == force).all() for one in bench.pressed[2:])
    _, again, _, deviations, grips = bench.fits["add_modes"]
    assert (again == place).all()
    assert deviations.shape == (6, 70, 3, 3)
    assert list(grips) == [2] * 6
    assert (deviations > 4e6).all()
    read = (deviations[:, 0, 0, 0] + 25.0) / (5_000_025.0 + np.repeat(np.arange(3), 2))
    assert len(set(read.round(9))) == 6
    assert (read > 1).all() and (read < 2).all()  # noqa: PT018


def test_a_table_of_little_effort_has_neither_pairs_nor_modes(planar, monkeypatch):
    bench = Bench(monkeypatch)
    bench.table = reduced_table(planar)
    make_table(planar, Effort(presses=50, pairs=0, skins=1, draws=1, presses_a_skin=5))
    assert set(bench.fits) == {"fit_response_table", "add_warmth"}


def test_the_usual_effort_is_that_of_the_table_that_ships():
    assert asdict(Effort()) == {
        "presses": 12_000, "pairs": 4_000, "skins": 96, "draws": 4, "presses_a_skin": 640,
        "force": (0.05, 1.15), "drag": 0.6, "seed": 0,
    }  # fmt: skip


def test_impossible_efforts_are_refused():
    for wrong in ({"presses": 0}, {"pairs": -1}, {"skins": 0}, {"draws": 0}, {"presses_a_skin": 0}):
        with pytest.raises(ArgumentError, match="counts must be positive"):
            Effort(**wrong)
    for wrong in ({"force": (0.0, 1.0)}, {"force": (0.5, 0.5)}, {"drag": -0.1}):
        with pytest.raises(ArgumentError, match="force must rise from above 0"):
            Effort(**wrong)
    assert Effort(pairs=0, drag=0.0).pairs == 0


@pytest.mark.slow
def test_a_table_is_made_from_presses_of_the_twin(planar):
    pytest.importorskip("jax")
    small = Effort(presses=3700, pairs=200, skins=3, draws=2, presses_a_skin=120)
    shares = []
    table = make_table(planar, small, progress=lambda task, share: shares.append(share))
    assert shares == sorted(shares)
    assert np.sqrt(np.diag(table.misfit)).max() < 100e-6
    assert len(table.modes) >= 3
    assert table.origin["effort"] == asdict(small)
