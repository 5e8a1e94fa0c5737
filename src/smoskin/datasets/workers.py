"""Engine that computes the chunks of a sweep: processes of this machine, or a cluster's.

Decides how work reaches workers, what happens when one dies (its item, and no other, is computed
again) and how long anyone waits. Numerics in workers have one thread each, so that a result does
not depend on how many workers there are. Hides loky, whose processes compute on this machine, and
dask, which hands work to a cluster.
"""

import functools
import logging
import os
import pickle
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import ExitStack
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias, TypeVar, final

from smoskin.errors import ArgumentError, EngineError, MissingExtraError

Result = TypeVar("Result")
_Opened: TypeAlias = tuple[Callable[[], Executor], Callable[[], int], Callable[..., Any]]

#: Environment of every worker: each library's arithmetic in one thread (NPROC is XLA's).
ONE_THREAD: Final[Mapping[str, str]] = MappingProxyType(
    {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NPROC": "1"}
)
_CHECKED: Final = ("OMP_NUM_THREADS", "NPROC")
_HERE: Final = "local"
"""Stands for the address of a dask cluster that is started on this machine."""
_LIVES: Final = 3
"""Workers that an item may end before it is given up."""
_CONNECT: Final = 15.0
"""Longest wait for a scheduler or its first worker, s."""
_ORPHAN: Final = 0.2
"""Time between a worker's looks at whether its parent lives, s."""


class _Job(NamedTuple):
    """An item on a worker."""

    item: int
    pool: Executor
    """Executor of one process, so that a death is blamed on one item alone; or the cluster's."""
    due: float
    """Moment on the monotonic clock by which it must be done, s."""


@final
class Engine:
    """Computes items in worker processes; the results come as they are done.

    Parameters
    ----------
    workers : int, optional
        Number of processes; one a core by default.
    scheduler : str, optional
        Address of a running dask scheduler, such as ``tcp://10.0.0.1:8786``, or ``local`` for a
        cluster that is started on this machine; without it plain processes compute.

    Raises
    ------
    ArgumentError
        If workers are given beside a scheduler that has its own, or fewer than one.

    Notes
    -----
    Workers of a running cluster need this package and one thread each: start them with
    ``OMP_NUM_THREADS=1 NPROC=1 dask worker --nthreads 1``; others are refused.

    Examples
    --------
    >>> import math
    >>> sorted(Engine(1).run(math.factorial, [3, 4]))
    [(3, 6), (4, 24)]
    """

    def __init__(self, workers: int | None = None, scheduler: str | None = None) -> None:
        if workers is not None and scheduler not in (None, _HERE):
            raise ArgumentError("workers must be left out where a scheduler has its own")
        self.workers = len(os.sched_getaffinity(0)) if workers is None else workers
        if self.workers < 1:
            raise ArgumentError(f"workers must be at least 1; got {workers}")
        self.scheduler = scheduler

    @property
    def name(self) -> str:
        """Name of the engine, for people."""
        if self.scheduler is None:
            return f"local, {self.workers} worker{'s' * (self.workers > 1)}"
        return f"dask, {'on this machine' if self.scheduler == _HERE else self.scheduler}"

    def run(
        self, work: Callable[[int], Result], items: Sequence[int], *, deadline: float = 600.0
    ) -> Iterator[tuple[int, Result]]:
        """Each item with its result, exactly once, in the order of completion.

        Parameters
        ----------
        work : callable
            Takes an item; must be picklable and the same for the same item wherever it runs.
        deadline : float, optional
            Time that one item may take, the start of its worker included, s.

        Raises
        ------
        EngineError
            If the work raises, an item takes longer, or ends several workers one after another.
        """
        payload = _packed(work, deadline)
        waiting, deaths = deque(items), Counter[int]()
        running: dict[Future[Result], _Job] = {}
        idle: list[Executor] = []
        done: list[tuple[int, Result]] = []
        with ExitStack() as stack:
            start, room, compute = self._open(stack)
            while waiting or running:
                while waiting and len(running) < room():
                    pool, item = idle.pop() if idle else start(), waiting.popleft()
                    future = pool.submit(compute, payload, item)
                    running[future] = _Job(item, pool, time.monotonic() + deadline)
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
                        if isinstance(error, EngineError):
                            raise error
                        raise EngineError(
                            f"item {job.item}: {type(error).__name__}: {error}"
                        ) from error
            yield from done

    def _open(self, stack: ExitStack) -> _Opened:
        """What starts a worker, how many may be busy, and what computes an item on one."""
        if self.scheduler is not None:
            return self._open_cluster(stack, self.scheduler)
        try:
            from loky.process_executor import ProcessPoolExecutor
        except ImportError as error:
            raise MissingExtraError("a sweep in processes", "data") from error

        def start() -> Executor:
            pool = ProcessPoolExecutor(
                1, env=dict(ONE_THREAD), initializer=_end_with_parent, initargs=(os.getpid(),)
            )
            stack.callback(functools.partial(pool.shutdown, wait=True, kill_workers=True))
            return pool  # type: ignore[no-any-return]

        return start, lambda: self.workers, _computed

    def _open_cluster(self, stack: ExitStack, address: str) -> _Opened:
        """The same on a dask cluster, which has a dead worker's items computed again itself."""
        distributed = _distributed()
        place: Any = address
        if address == _HERE:
            place = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=self.workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=":0",
                    silence_logs=logging.CRITICAL,
                    env=dict(ONE_THREAD),
                )
            )
        try:
            client = stack.enter_context(distributed.Client(place, timeout=_CONNECT))
            client.wait_for_workers(1, timeout=_CONNECT)
        except (OSError, TimeoutError, ValueError) as error:
            raise EngineError(f"no dask scheduler answers at {address}: {error}") from error
        executor = client.get_executor(pure=False)

        def room() -> int:
            # One item a worker: more would be blamed for the death of a worker that they wait for.
            return max(1, int(sum(client.nthreads().values())))

        return lambda: executor, room, _computed_alone


def _ready(running: Mapping[Future[Result], _Job], deadline: float) -> list[Future[Result]]:
    """Futures that are done; waits for the first."""
    first = min(running.values(), key=lambda job: job.due)
    left = max(first.due - time.monotonic(), 0.0)
    ready = wait(running, timeout=left, return_when=FIRST_COMPLETED).done
    if not ready:
        raise EngineError(f"item {first.item} took longer than {deadline:g} s")
    return list(ready)


def _end_with_parent(parent: int) -> None:
    """End this process as soon as its parent is gone; Ctrl-C is the parent's to hear."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_ORPHAN)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


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


def _computed_alone(payload: bytes, item: int) -> Any:
    """One item, on a worker of a cluster, which must have one thread."""
    threads = _distributed().get_worker().state.nthreads
    wrong = [f"{name} unset" for name in _CHECKED if os.environ.get(name) != ONE_THREAD[name]]
    if threads != 1 or wrong:
        raise EngineError(
            f"a cluster's workers must have one thread each (--nthreads 1, "
            f"{' '.join(f'{name}=1' for name in _CHECKED)}); got {threads} threads, "
            f"{', '.join(wrong) or 'all set'}"
        )
    return _computed(payload, item)


def _packed(work: Callable[[int], object], deadline: float) -> bytes:
    """The work as it travels."""
    if not deadline > 0:
        raise ArgumentError(f"deadline must be positive; got {deadline}")
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ArgumentError(f"work must be picklable: {error}") from error
