"""Engines: every item once, whatever becomes of the workers."""

import math
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

import chunk_work as work
from smoskin.datasets.workers import ONE_THREAD, Engine
from smoskin.errors import ArgumentError, EngineError

ITEMS = tuple(range(8))


@pytest.fixture(scope="module")
def scheduler():
    """Address of a cluster of two worker processes."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=":0",
        silence_logs=50,
        env=dict(ONE_THREAD),
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(params=["local", pytest.param("dask", marks=pytest.mark.slow)])
def engine(request):
    if request.param == "local":
        return Engine(2)
    return Engine(scheduler=request.getfixturevalue("scheduler"))


def squares(items=ITEMS):
    return [(item, item * item) for item in items]


def kill_one_later(folder, after):
    """A thread that kills whoever began the latest item, once so many have begun."""

    def wait_and_kill():
        for _ in range(2000):
            seen = work.begun(folder)
            if len(seen) >= after:
                os.kill(seen[-1][1], signal.SIGKILL)
                return
            time.sleep(0.005)

    thread = threading.Thread(target=wait_and_kill)
    thread.start()
    return thread


def test_every_item_comes_once(engine, tmp_path):
    assert sorted(engine.run(work.Square(str(tmp_path)), ITEMS)) == squares()
    assert list(engine.run(work.Square(str(tmp_path)), ())) == []


def test_both_workers_work(engine, tmp_path):
    list(engine.run(work.Square(str(tmp_path), 0.05), ITEMS))
    assert len({pid for _, pid in work.begun(tmp_path)}) == 2


def test_a_killed_worker_loses_nothing_and_doubles_nothing(engine, tmp_path):
    killer = kill_one_later(tmp_path, 3)
    done = list(engine.run(work.Square(str(tmp_path), 0.1), ITEMS))
    killer.join()
    assert sorted(done) == squares()
    assert len(work.begun(tmp_path)) > len(ITEMS)


def test_a_worker_that_kills_itself_once_is_forgiven(engine, tmp_path):
    assert sorted(engine.run(work.Deadly(str(tmp_path), 1), ITEMS)) == squares()


@pytest.mark.parametrize("scheduler", [None, pytest.param("local", marks=pytest.mark.slow)])
def test_an_item_that_ends_every_worker_is_given_up(scheduler, tmp_path):
    pytest.importorskip("distributed")
    engine = Engine(2, scheduler)
    with pytest.raises(EngineError, match=r"item 2 ended 3 workers|item \d: KilledWorker: .* died"):
        list(engine.run(work.Deadly(str(tmp_path), 99), ITEMS))
    if scheduler is None:
        assert sum(item == 2 for item, _ in work.begun(tmp_path)) == 3


def test_what_the_work_raises_is_told_with_its_item(engine):
    with pytest.raises(EngineError, match="item 1: ValueError: one is too few"):
        list(engine.run(work.refuse, ITEMS))


def test_nobody_waits_past_the_deadline(engine, tmp_path):
    begun = time.monotonic()
    with pytest.raises(EngineError, match=r"item \d took longer than 1 s"):
        list(engine.run(work.Square(str(tmp_path), 4.0), ITEMS[:2], deadline=1.0))
    assert time.monotonic() - begun < 30


def test_numerics_of_workers_have_one_thread(engine):
    (item, seen), *_ = engine.run(work.environment, (0,))
    assert item == 0
    assert dict(ONE_THREAD).items() <= seen.items()


def test_wrong_use(engine):
    with pytest.raises(ArgumentError, match="work must be picklable"):
        list(engine.run(lambda item: item, ITEMS))
    with pytest.raises(ArgumentError, match="deadline must be positive; got 0"):
        list(engine.run(math.factorial, ITEMS, deadline=0))


def test_only_the_item_of_the_killed_worker_is_computed_again(tmp_path):
    list(Engine(2).run(work.Deadly(str(tmp_path), 1), ITEMS))
    counts = [sum(started == item for started, _ in work.begun(tmp_path)) for item in ITEMS]
    assert counts == [1, 1, 2, 1, 1, 1, 1, 1]


def test_workers_end_with_a_consumer_that_stops(tmp_path):
    results = Engine(2).run(work.Square(str(tmp_path), 0.05), range(100))
    next(results)
    results.close()
    assert [pid for _, pid in work.begun(tmp_path) if alive(pid)] == []


def test_workers_end_with_a_killed_parent(tmp_path):
    program = (
        "import sys; import chunk_work as work\n"
        "from smoskin.datasets.workers import Engine\n"
        "list(Engine(2).run(work.Square(sys.argv[1], 60.0), range(4)))\n"
    )
    path = os.pathsep.join([os.path.dirname(work.__file__), *sys.path])
    parent = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], env=os.environ | {"PYTHONPATH": path}
    )
    try:
        until(lambda: len(work.begun(tmp_path)) == 2)
    finally:
        parent.kill()
        parent.wait()
    until(lambda: not any(alive(pid) for _, pid in work.begun(tmp_path)))
    assert len(work.begun(tmp_path)) == 2


def test_a_crowd_of_workers_is_refused_by_name(tmp_path):
    with pytest.raises(ArgumentError, match="workers must be at least 1; got 0"):
        Engine(0)
    with pytest.raises(ArgumentError, match="workers must be at least 1; got 0"):
        Engine(0, "local")
    with pytest.raises(ArgumentError, match="workers must be left out"):
        Engine(2, "tcp://10.0.0.1:8786")
    assert (Engine(1).name, Engine(2).name) == ("local, 1 worker", "local, 2 workers")
    here = Engine(3, "local")
    assert (here.name, here.workers) == ("dask, on this machine", 3)
    assert Engine(None, "tcp://here:1").name == "dask, tcp://here:1"


def test_a_cluster_whose_workers_have_many_threads_is_refused():
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0"
        ) as cluster,
        pytest.raises(EngineError, match=r"one thread each .* got 2 threads"),
    ):
        list(Engine(scheduler=cluster.scheduler_address).run(math.factorial, (3,)))


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("smoskin.datasets.workers._CONNECT", 0.5)
    with pytest.raises(EngineError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        list(Engine(scheduler="tcp://127.0.0.1:9").run(math.factorial, (3,)))


def until(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def alive(pid):
    """Whether a process still runs; one that only waits to be reaped does not."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
