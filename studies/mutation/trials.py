"""Which tests judge a fault, and how they are run: the nearest first, the default tier last.

A test counts only where it passes on the sound code, so that one which fails anyway, here or
always, kills nothing. Hides the copies of the project, one a worker, in which faults are made.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from importlib.util import cache_from_source
from pathlib import Path
from queue import SimpleQueue
from threading import Lock
from typing import Final, Literal

from smoskin.errors import ArgumentError
from studies.mutation.faults import Fault

Tier = Literal["mirror", "importers", "default"]
"""How far tests go: those of the module and its folder, those that import it, or all."""
Outcome = Literal["killed", "survived", "timed out"]
TIERS: Final[tuple[Tier, ...]] = ("mirror", "importers", "default")
_SOURCES: Final = "src/smoskin"
_LEFT_OUT: Final = (".git", ".venv", "__pycache__", ".*_cache", "*.egg-info", "node_modules")
_SUMMARY: Final = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.M)
_ENDLESS: Final = "the tests do not end"
_MOST_UNSOUND: Final = 20
"""Tests that may fail on the sound code before the copy itself must be wrong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What the tests said of one fault."""

    path: str
    line: int
    kind: str
    diff: str
    outcome: Outcome
    tier: Tier
    """How far the tests had to go."""
    by: str
    """The test that noticed it, or how else it shows; empty where it does not."""

    @property
    def text(self) -> str:
        """The judgement as people read it, with its diff unless it was killed."""
        head = f"{self.outcome:9} {self.path}:{self.line} {self.kind}"
        return f"{head}: {self.by}" if self.by else f"{head}\n{self.diff}"


class Bench:
    """A copy of the project in which one fault after the other is made and judged.

    Parameters
    ----------
    root : Path
        The project; it is left as it is.
    folder : Path
        An empty folder for the copy.
    deadline : float
        s that the tests of one tier may take.
    """

    def __init__(self, root: Path, folder: Path, deadline: float) -> None:
        self._copy = folder / "project"
        self._deadline = deadline
        self._unsound: list[str] = []
        shutil.copytree(root, self._copy, symlinks=True, ignore=shutil.ignore_patterns(*_LEFT_OUT))
        # Tests look for what lies beside the project by relative names.
        if (root.parent / "shared").exists():
            (folder / "shared").symlink_to((root.parent / "shared").resolve())

    def judge(self, fault: Fault, last: Tier) -> Judgement:
        """Make the fault, run tests up to a tier until one notices, and mend it again."""
        path = self._copy / fault.path
        source = path.read_text("utf-8")
        outcome: Outcome = "survived"
        by, tier = "", last
        for tier in TIERS[: TIERS.index(last) + 1]:
            self._write(path, fault.applied(source))
            try:
                outcome, by = self._run(fault, tier, path, source)
            finally:
                self._write(path, source)
            if outcome != "survived":
                break
        return Judgement(
            path=fault.path,
            line=fault.line,
            kind=fault.kind,
            diff=fault.diff(source),
            outcome=outcome,
            tier=tier,
            by=by,
        )

    def _run(self, fault: Fault, tier: Tier, path: Path, source: str) -> tuple[Outcome, str]:
        """Run the tests of one tier until one fails that passes on the sound code."""
        faulty = path.read_text("utf-8")
        while tests := [
            name for name in judges_of(self._copy, fault.path, tier) if name not in self._unsound
        ]:
            code, output = self._pytest(tests)
            if code is None:
                # Tests that end on the sound code alone: whoever runs them notices.
                self._write(path, source)
                sound, _ = self._pytest(tests)
                return ("timed out", "") if sound is None else ("killed", _ENDLESS)
            if code in (0, 5):  # passed, or nothing to run
                break
            failed = _SUMMARY.findall(output)
            # Without a name the run itself broke, as where a fixture's file cannot be imported.
            asked = failed[:1] or ["--collect-only", *tests]
            self._write(path, source)
            sound, _ = self._pytest(asked)
            if sound == 0:
                return "killed", failed[0] if failed else "the tests cannot be collected"
            self._unsound += failed[:1] or ["the tests cannot be collected"]
            if not failed or len(self._unsound) > _MOST_UNSOUND:
                raise ArgumentError(
                    "the tests must pass on the sound code; these fail there: "
                    + ", ".join(self._unsound)
                )
            self._write(path, faulty)
        return "survived", ""

    def _pytest(self, arguments: Sequence[str]) -> tuple[int | None, str]:
        """Exit code, none past the deadline, and output of a run of tests."""
        skipped = [
            f"--{'deselect' if '::' in name else 'ignore'}={name}"
            for name in self._unsound
            if name not in arguments
        ]
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
        with subprocess.Popen(
            [*command, *skipped, *arguments],
            cwd=self._copy,
            env=_environment(self._copy),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        ) as process:
            try:
                output, _ = process.communicate(timeout=self._deadline)
            except subprocess.TimeoutExpired:
                return None, ""
            finally:
                # Whatever tests started ends with them.
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
        return process.returncode, output

    @staticmethod
    def _write(path: Path, text: str) -> None:
        """Write a source file so that no compiled one of the same second is taken for it."""
        path.write_text(text, "utf-8")
        Path(cache_from_source(str(path))).unlink(missing_ok=True)


def _environment(copy: Path) -> Mapping[str, str]:
    """Variables under which tests import the copy, and compute on one thread."""
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    # Faults are judged in parallel, not their tests: the first failure ends a run at once.
    one_thread["PYTEST_XDIST_AUTO_NUM_WORKERS"] = "0"
    return os.environ | one_thread | {"PYTHONPATH": f"{copy / 'src'}{os.pathsep}{copy}"}


def judges_of(root: Path, path: str, tier: Tier) -> list[str]:
    """Arguments for pytest: the tests of one tier that judge faults of a source file.

    Parameters
    ----------
    root : Path
        The project.
    path : str
        The source file, relative to the root.
    tier : Tier
        `mirror`: the module's examples and tests, then all of the folder that mirrors its own.
        `importers`: further files that name the module. `default`: everything.
    """
    if tier == "default":
        return ["src", "tests"]
    module = Path(path).relative_to("src")
    mirror = Path("tests", *module.parts[1:]).with_name(f"test_{module.name}")
    near = mirror.parent if len(module.parts) > 2 else mirror
    if tier == "mirror":
        wanted = (path, str(mirror), str(near))
        return [name for name in dict.fromkeys(wanted) if (root / name).exists()]
    return sorted(
        str(file.relative_to(root))
        for file in (root / "tests").rglob("test_*.py")
        if _names(file.read_text("utf-8"), module)
        and not file.relative_to(root).is_relative_to(near)
    )


def _names(text: str, module: Path) -> bool:
    """Whether a test's text imports a module, or names it, with the package's name or without."""
    parts = module.with_suffix("").parts
    if parts[-1] == "__init__":
        parts = parts[:-1]
    folder, name = ".".join(parts[:-1]), parts[-1]
    inside = ".".join(parts[1:]) if len(parts) > 2 else ".".join(parts)
    dotted = rf"\b{re.escape(inside)}\b"
    return bool(re.search(rf"{dotted}|from {re.escape(folder)} import [^\n]*\b{name}\b", text))


def judge_all(
    root: Path,
    faults: Iterable[Fault],
    *,
    workers: int = 1,
    deadline: float = 900.0,
    last: Tier = "default",
    progress: Callable[[Judgement, Fault], None] = lambda judgement, fault: None,
) -> list[Judgement]:
    """Judge faults, several at a time; `progress` is told of each as it is done.

    Raises
    ------
    ArgumentError
        If a fault lies outside of the package's sources, or the tests fail on the sound code.
    """
    listed = list(faults)
    for fault in listed:
        if not Path(fault.path).is_relative_to(_SOURCES):
            raise ArgumentError(f"path must lie below {_SOURCES}; got {fault.path}")
    reporting = Lock()
    benches: SimpleQueue[Bench] = SimpleQueue()

    def judge(fault: Fault) -> Judgement:
        bench = benches.get()
        try:
            judgement = bench.judge(fault, last)
        finally:
            benches.put(bench)
        with reporting:
            progress(judgement, fault)
        return judgement

    with ExitStack() as stack:
        for _ in range(workers):
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="mutation-"))
            benches.put(Bench(root, Path(folder), deadline))
        with ThreadPoolExecutor(workers) as pool:
            return list(pool.map(judge, listed))


def sources(root: Path, rooms: Iterable[str]) -> Iterator[str]:
    """Source files of rooms: folders or modules below `src/smoskin`.

    Raises
    ------
    ArgumentError
        If there is no such room.
    """
    for room in rooms:
        place = root / _SOURCES / room
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
        if not files or not files[0].is_file():
            raise ArgumentError(f"room must be a folder or module of {_SOURCES}; got {room!r}")
        yield from (str(file.relative_to(root)) for file in files)


def as_json(judgements: Mapping[str, Judgement]) -> dict[str, object]:
    """Plain values for machines."""
    return {key: asdict(judgement) for key, judgement in judgements.items()}
