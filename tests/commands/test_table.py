"""`smoskin table`: the table that it makes, and what it says of it."""

import json
import shutil
from dataclasses import asdict, replace
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.commands.table import Effort, make_table
from smoskin.datasets.patterns import Repeated
from smoskin.datasets.store import open_dataset
from smoskin.datasets.workers import Engine
from smoskin.errors import ArgumentError, RecordingError
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.sensing.response.table import load_response_table
from smoskin.twin.manufacture import Tolerances
from tables_of_response import reduced_table


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_a_table_is_made_with_the_effort_asked_for(planar, tmp_path, monkeypatch):
    asked, where = [], []

    def made(design, effort, folder, engine, progress):
        asked.append(effort)
        where.append((folder, engine.workers))
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
    kept = ("--folder", tmp_path / "kept", "--workers", 3)
    machines = run("table", "planar", "--out", tmp_path / "c.table", *kept, "--json")
    assert where == [(None, Engine().workers), (tmp_path / "kept", 3)]
    answer = json.loads(machines.stdout)
    assert answer["chips"] == [0, 1, 2]
    assert answer["file"] == str(tmp_path / "c.table")
    assert answer["modes"] == 0
    assert asked[-1] == Effort()
    assert (tmp_path / "c.table").exists()


def test_too_few_presses_are_refused_before_any(planar):
    with pytest.raises(ArgumentError, match="presses must be at least 3630 of this design; got 40"):
        make_table(planar, Effort(presses=400))


class Bench:
    """Stands for presses, chips and fits: keeps what they are asked, answers with plain numbers."""

    def __init__(self, monkeypatch, table):
        self.table, self.sweeps, self.fits = table, {}, {}
        for name in ("fit_response_table", "add_coupling", "add_warmth", "add_modes"):
            monkeypatch.setattr(f"smoskin.commands.table.{name}", self.fit(name))
        monkeypatch.setattr("smoskin.commands.table.write_dataset", self.write_dataset)
        monkeypatch.setattr("smoskin.commands.table.Readout", self.readout)
        monkeypatch.setattr("smoskin.commands.table.Twin", self.twin)
        monkeypatch.setattr(
            "smoskin.commands.table.grip_compliance", lambda design, *made: made or (design,)
        )
        monkeypatch.setattr(
            "smoskin.commands.table.made_mechanics", lambda design, deviations, t: (*deviations, t)
        )
        monkeypatch.setattr(
            "smoskin.commands.table.draw", lambda design, rng, tolerances: rng.uniform(1, 2)
        )

    def fit(self, name):
        def keep(*given, **named):
            assert set(named) <= {"coupling", "curvature"}
            self.fits[name] = given
            return self.table

        return keep

    def write_dataset(self, path, design, sweep, *, engine, progress):
        self.sweeps[path.name] = (path.parent, sweep, engine)
        progress("5 rows", 0.5)
        return SimpleNamespace(sweep=sweep, chunks=lambda: self.rows(design, sweep))

    def rows(self, design, sweep):
        """Magnets move by the temperature and the skin's seed; every fifth press finds no rest."""
        for chunk in range(sweep.chunks):
            touches = sweep.touches(design, chunk)
            size = float(sweep.temperature(chunk) + (sweep.skin(chunk) or 0))
            motion = Motion.rest(len(design.magnets), (len(touches),))
            motion = Motion(magnets=motion.magnets + size, board=motion.board)
            if "pairs" in self.sweeps and sweep is self.sweeps["pairs"][1]:
                motion = motion.where(np.arange(len(touches)) % 5 > 0)
            yield SimpleNamespace(position=touches.position, force=touches.force, motion=motion)

    def readout(self, design, made=1.0):
        return SimpleNamespace(risen=lambda motion: made * motion.magnets[:, :, :3])

    def twin(self, design, *, seed, manufactured, tolerances):
        assert manufactured
        return SimpleNamespace(deviations=(seed, tolerances.remanence if tolerances else 0.0))


def test_a_table_is_made_of_the_presses_that_its_effort_names(planar, monkeypatch, tmp_path):
    bench = Bench(monkeypatch, reduced_table(planar))
    effort = Effort(presses=4000, pairs=500, skins=3, draws=2, presses_a_skin=70, seed=4)
    tolerances, engine, events = Tolerances(remanence=0.01), Engine(2), []
    table = make_table(
        planar,
        effort,
        tolerances=tolerances,
        folder=tmp_path,
        engine=engine,
        progress=lambda task, share: events.append((task, share)),
    )
    assert table.origin == {"smoskin": version("smoskin"), "effort": asdict(effort)}
    given = [(path, engine) for path, _, engine in bench.sweeps.values()]
    assert given == [(tmp_path, engine)] * 4
    assert [task for task, _ in events] == [
        "designed: 5 rows", "pairs: 5 rows", "warmth: 5 rows", "skins: 5 rows"
    ]  # fmt: skip
    begun = np.cumsum([0, 4000, 500, 210, 210])
    assert [share for _, share in events] == pytest.approx((begun[1:] + begun[:-1]) / 2 / begun[-1])
    sweeps = {name: sweep for name, (_, sweep, _) in bench.sweeps.items()}
    patterns = [sweep.presses for sweep in sweeps.values()]
    forces, cell = effort.force, geometry(planar).cell
    assert patterns == [
        Repeated(count=4000, forces=forces, drag=0.6, seed=12),
        Repeated(count=500, forces=forces, apart=float(max(cell.length, cell.width)), seed=13),
        *[Repeated(count=70, forces=forces, drag=0.6, seed=14)] * 2,
    ]
    _, place, force, _ = bench.fits["fit_response_table"]
    assert (place.shape, force.shape) == ((4000, 2), (4000, 3))
    # Pairs that found an equilibrium.
    _, grip, place, force, both = bench.fits["add_coupling"]
    assert grip == (planar,)
    assert (place.shape, force.shape, both.shape) == ((399, 2, 2), (399, 2, 3), (399, 3, 3))
    # A degree's share of the step from ten below to ten above the reference.
    _, place, force, per_degree = bench.fits["add_warmth"]
    assert sweeps["warmth"].temperatures == (15.0, 25.0, 35.0)
    assert (place.shape, force.shape) == ((70, 2), (70, 3))
    np.testing.assert_allclose(per_degree, 1.0)
    # The same presses on every made skin, each read by two draws of chips and magnets.
    assert sweeps["skins"].skins == (5_000_000, 5_000_001, 5_000_002)
    assert sweeps["skins"].tolerances == tolerances
    assert sweeps["skins"].chunks == 3
    _, again, _, deviations, grips = bench.fits["add_modes"]
    assert (again == place).all()
    assert deviations.shape == (6, 70, 3, 3)
    seeds = np.repeat(sweeps["skins"].skins, 2)
    assert grips.tolist() == [[seed, 0.01, 25.0] for seed in seeds]
    read = (deviations[:, 0, 0, 0] + 25.0) / (25.0 + seeds)
    assert len(set(read.round(9))) == 6
    assert (read > 1).all() and (read < 2).all()  # noqa: PT018


def test_a_table_of_little_effort_has_neither_pairs_nor_modes(planar, monkeypatch):
    bench = Bench(monkeypatch, reduced_table(planar))
    make_table(planar, Effort(presses=4000, pairs=0, skins=1, draws=1, presses_a_skin=5))
    assert set(bench.fits) == {"fit_response_table", "add_warmth"}
    (folder,) = {path for path, _, _ in bench.sweeps.values()}
    assert not folder.exists()


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
def test_a_table_that_was_interrupted_is_the_same_to_the_last_bit(planar, tmp_path):
    pytest.importorskip("jax")
    pytest.importorskip("h5py")
    small = Effort(presses=3700, pairs=200, skins=3, draws=2, presses_a_skin=120)
    folder, shares = tmp_path / "presses", []
    table = make_table(
        planar, small, folder=folder, progress=lambda task, share: shares.append(share)
    )
    assert shares == sorted(shares)
    assert np.sqrt(np.diag(table.misfit)).max() < 100e-6
    assert len(table.modes) >= 3
    assert table.origin["effort"] == asdict(small)
    table.save(tmp_path / "whole.table")
    lost = [folder / "designed" / "chunk-000003.h5", folder / "skins" / "chunk-000001.h5"]
    for file in lost:
        file.unlink()
    shutil.rmtree(folder / "pairs")
    damaged = folder / "warmth" / "chunk-000000.h5"
    damaged.write_bytes(damaged.read_bytes()[:-1])
    again = make_table(planar, small, folder=folder, engine=Engine(1))
    again.save(tmp_path / "again.table")
    assert (tmp_path / "again.table").read_bytes() == (tmp_path / "whole.table").read_bytes()
    runs = open_dataset(folder / "skins").manifest.runs
    assert [(run.chunks, run.engine) for run in runs][1:] == [(1, "local, 1 worker")]
    with pytest.raises(RecordingError, match=r"presses.count is 3700 there and 3701 here"):
        make_table(planar, replace(small, presses=3701), folder=folder)
