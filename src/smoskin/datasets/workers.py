"""Engines that compute the chunks of a sweep: processes of this machine, or a cluster's.

Decides how work reaches workers, what happens when one dies (its item, and no other, is computed
again) and how long anyone waits. Numerics in workers have one thread each, so that a result does
not depend on how many workers there are. Processes are loky's on this machine, dask's on a cluster.
"""

import functools
import logging
import os
import pickle
import signal
import threading
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future
from concurrent.futures import wait as wait_for
from contextlib import ExitStack, contextmanager, suppress
from types import MappingProxyType
from typing import Any, Final, NamedTuple, Protocol, TypeVar, final

from smoskin.errors import ArgumentError, EngineError, MissingExtraError

Result = TypeVar("Result")

#: Environment of every worker: each library's arithmetic in one thread (NPROC is XLA's).
ONE_THREAD: Final[Mapping[str, str]] = MappingProxyType(
    {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
        "NPROC": "1",
    }
)
_CHECKED: Final = ("OMP_NUM_THREADS", "NPROC")
_LIVES: Final = 3
"""How many workers an item may end before it is given up."""
_CONNECT, _START = 15.0, 60.0
"""s: longest waits for a scheduler to answer and for a cluster's workers to come back."""
_LOOK, _FETCH = 1.0, 30.0
"""s: between looks at a cluster's health, and for one result to come over."""
_FETCHES: Final = 10
"""How often a result may be lost on its way."""
_ORPHAN: Final = 0.2
"""s between a worker's looks at whether its parent lives."""


class Engine(Protocol):
    """Computes items somewhere; the results come as they are done."""

    @property
    def name(self) -> str:
        """Name of the engine, for people."""
        ...

    def run(
        self, work: Callable[[int], Result], items: Sequence[int], *, deadline: float = 600.0
    ) -> Iterator[tuple[int, Result]]:
        """Each item with its result, exactly once, in the order of completion.

        Parameters
        ----------
        work : callable
            Takes an item; must be picklable and the same for the same item wherever it runs.
        items : sequence of int
        deadline : float, optional
            s that one item may take, the start of its worker included.

        Raises
        ------
        EngineError
            If the work raises, an item takes longer, or ends several workers one after another.
        """
        ...


class _Job(NamedTuple):
    """An item on a worker."""

    item: int
    pool: Any
    """The worker: loky's executor of one process, so that a death is blamed on one item alone."""
    due: float
    """Moment on the monotonic clock by which it must be done, s."""


@final
class LocalEngine:
    """Worker processes on this machine.

    Parameters
    ----------
    workers : int, optional
        How many processes; one a core by default.

    Examples
    --------
    >>> import math
    >>> sorted(LocalEngine(1).run(math.factorial, [3, 4]))
    [(3, 6), (4, 24)]
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = len(os.sched_getaffinity(0)) if workers is None else workers
        if self.workers < 1:
            raise ArgumentError(f"workers must be at least 1; got {workers}")

    @property
    def name(self) -> str:
        """Name of the engine, for people."""
        return f"local, {self.workers} worker{'s' * (self.workers > 1)}"

    def run(
        self, work: Callable[[int], Result], items: Sequence[int], *, deadline: float = 600.0
    ) -> Iterator[tuple[int, Result]]:
        """As `Engine.run` says."""
        payload, start = _packed(work, deadline), _starter()
        waiting, deaths = deque(items), Counter[int]()
        running: dict[Future[Result], _Job] = {}
        pools: list[Any] = []
        idle: list[Any] = []
        done: list[tuple[int, Result]] = []
        try:
            while waiting or running:
                while waiting and len(running) < self.workers:
                    if not idle:
                        idle.append(start())
                        pools.append(idle[-1])
                    job = _Job(waiting.popleft(), idle.pop(), time.monotonic() + deadline)
                    running[job.pool.submit(_computed, payload, job.item)] = job
                # Workers are busy again before results are handed on, which may take its time.
                yield from done
                done = []
                for future in _ready(running, deadline):
                    job = running.pop(future)
                    error = future.exception()
                    if error is None:
                        done.append((job.item, future.result()))
                        idle.append(job.pool)
                    elif isinstance(error, BrokenExecutor):
                        deaths[job.item] += 1
                        if deaths[job.item] == _LIVES:
                            raise EngineError(f"item {job.item} ended {_LIVES} workers") from error
                        waiting.appendleft(job.item)
                    else:
                        yield from done
                        raise EngineError(
                            f"item {job.item}: {type(error).__name__}: {error}"
                        ) from error
            yield from done
        finally:
            for pool in pools:
                pool.shutdown(wait=True, kill_workers=True)


def _ready(running: Mapping[Future[Result], _Job], deadline: float) -> list[Future[Result]]:
    """Futures that are done; waits for the first."""
    first = min(running.values(), key=lambda job: job.due)
    left = max(first.due - time.monotonic(), 0.0)
    ready = wait_for(running, timeout=left, return_when=FIRST_COMPLETED).done
    if not ready:
        raise EngineError(f"item {first.item} took longer than {deadline:g} s")
    return list(ready)


def _starter() -> Callable[[], Any]:
    """What starts one worker process."""
    try:
        from loky.process_executor import ProcessPoolExecutor
    except ImportError as error:
        raise MissingExtraError("a sweep in processes", "data") from error
    return functools.partial(
        ProcessPoolExecutor,
        1,
        env=dict(ONE_THREAD),
        initializer=_end_with_parent,
        initargs=(os.getpid(),),
    )


def _end_with_parent(parent: int) -> None:
    """End this process as soon as its parent is gone, whatever it computes.

    Ctrl-C reaches the parent, which ends its workers in order.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_ORPHAN)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@final
class DaskEngine:
    """Workers of a dask.distributed cluster.

    Parameters
    ----------
    scheduler : str, optional
        Address of a running scheduler, such as ``tcp://10.0.0.1:8786``; without one, a cluster
        is started on this machine and ended afterwards.
    workers : int, optional
        How many processes to start where there is no scheduler; one a core by default.

    Notes
    -----
    Workers of a running cluster need this package and one thread each: start them with
    ``OMP_NUM_THREADS=1 NPROC=1 dask worker --nthreads 1``; others are refused.
    """

    def __init__(self, scheduler: str | None = None, *, workers: int | None = None) -> None:
        if scheduler is not None and workers is not None:
            raise ArgumentError("workers must be left out where a scheduler has its own")
        if workers is not None and workers < 1:
            raise ArgumentError(f"workers must be at least 1; got {workers}")
        self.scheduler = scheduler
        self.workers = workers

    @property
    def name(self) -> str:
        """Name of the engine, for people."""
        return f"dask, {self.scheduler or 'on this machine'}"

    def run(
        self, work: Callable[[int], Result], items: Sequence[int], *, deadline: float = 600.0
    ) -> Iterator[tuple[int, Result]]:
        """As `Engine.run` says."""
        payload = _packed(work, deadline)
        name = uuid.uuid4().hex
        waiting = deque(items)
        fetched: Counter[int] = Counter()
        with _client(self.scheduler, self.workers) as client:
            running: dict[Any, int] = {}
            while waiting or running:
                # One item a worker: more would be blamed for the death of a worker that they
                # only wait for.
                room = max(1, sum(client.nthreads().values()))
                while waiting and len(running) < room:
                    item = waiting.popleft()
                    key = f"smoskin-{name}-{item}"
                    running[client.submit(_worked, payload, item, key=key, pure=False)] = item
                for future in _finished(client, running, deadline):
                    item = running.pop(future)
                    try:
                        result = _result(future, item)
                    except TimeoutError as error:
                        # Its worker has died with it: the scheduler has it computed again.
                        fetched[item] += 1
                        if fetched[item] == _FETCHES:
                            raise EngineError(f"the result of item {item} does not come") from error
                        running[future] = item
                        continue
                    yield item, result


@contextmanager
def _client(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A connection to the cluster, or to one of its own that ends with it."""
    distributed = _distributed()
    with ExitStack() as held:
        place: Any = scheduler
        if scheduler is None:
            place = held.enter_context(
                distributed.LocalCluster(
                    n_workers=workers or len(os.sched_getaffinity(0)),
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=":0",
                    silence_logs=logging.CRITICAL,
                    env=dict(ONE_THREAD),
                )
            )
        try:
            client = held.enter_context(distributed.Client(place, timeout=_CONNECT))
        except (OSError, TimeoutError, ValueError) as error:
            raise EngineError(f"no dask scheduler answers at {scheduler}: {error}") from error
        yield client


def _worked(payload: bytes, item: int) -> object:
    """One item, on a worker of the cluster."""
    threads = _distributed().get_worker().state.nthreads
    wrong = [f"{name} unset" for name in _CHECKED if os.environ.get(name) != ONE_THREAD[name]]
    if threads != 1 or wrong:
        raise EngineError(
            f"a cluster's workers must have one thread each (--nthreads 1, "
            f"{' '.join(f'{name}=1' for name in _CHECKED)}); got {threads} threads, "
            f"{', '.join(wrong) or 'all set'}"
        )
    return _computed(payload, item)


def _finished(client: Any, running: Mapping[Any, int], deadline: float) -> list[Any]:
    """Futures that are done; waits for the first."""
    begun = manned = time.monotonic()
    while True:
        with suppress(TimeoutError):
            wait = _distributed().wait
            return list(wait(list(running), timeout=_LOOK, return_when="FIRST_COMPLETED").done)
        now = time.monotonic()
        if now > begun + deadline:
            raise EngineError(f"none of items {sorted(running.values())} came in {deadline:g} s")
        if client.nthreads():
            manned = now
        elif now > manned + _START:
            raise EngineError(f"the cluster has had no workers for {_START:g} s")


def _result(future: Any, item: int) -> Any:
    """What a finished item returned; `TimeoutError` where it does not come."""
    if future.status == "finished":
        return future.result(timeout=_FETCH)
    if future.status == "error":
        error = future.exception(timeout=_FETCH)
        if isinstance(error, EngineError):
            raise error
        if isinstance(error, _distributed().KilledWorker):
            raise EngineError(f"item {item} saw several workers end: {error}") from error
        raise EngineError(f"item {item}: {type(error).__name__}: {error}") from error
    if future.status == "cancelled":
        raise EngineError(f"the cluster has cancelled item {item}")
    raise TimeoutError


def _distributed() -> Any:  # untyped
    """The library, which is there only where it is asked for."""
    try:
        import distributed
    except ImportError as error:
        raise MissingExtraError("a sweep on a cluster", "cluster") from error
    return distributed


@functools.lru_cache(maxsize=1)
def _unpacked(payload: bytes) -> Callable[[int], Any]:
    """The work of a payload, kept so that what it has prepared serves the next item too."""
    work: Callable[[int], Any] = pickle.loads(payload)
    return work


def _computed(payload: bytes, item: int) -> Any:
    """One item, on a worker."""
    return _unpacked(payload)(item)


def _packed(work: Callable[[int], object], deadline: float) -> bytes:
    """The work as it travels."""
    if not deadline > 0:
        raise ArgumentError(f"deadline must be positive; got {deadline}")
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ArgumentError(f"work must be picklable: {error}") from error
