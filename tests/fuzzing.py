"""Wrong inputs by the thousand, and what must hold of every answer to them.

Each case is a label and a check; `broken` runs them within a deadline and gives those whose check
raised anything. Cases are drawn from a seed, so that a label finds its case again.
"""

import contextlib
import io
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from smoskin.errors import SmoskinError

Case = tuple[str, Callable[[], None]]

DEADLINE = 10.0
"""s of computing that a case may take."""
LONGEST_WAIT = 60.0
"""s that it may take in all, on a machine with other work."""
LONGEST = 300
"""Characters of a message."""


class Hang(BaseException):
    """A case has met its deadline."""


class Began(BaseException):
    """Work of minutes would begin here: the arguments were taken."""


@dataclass(frozen=True)
class Answer:
    """What a command line came to."""

    code: int
    out: str
    err: str


def cases(few: int, many: int) -> pytest.MarkDecorator:
    """How many cases there are by default, and in the slow tier."""
    return pytest.mark.parametrize("count", [few, pytest.param(many, marks=pytest.mark.slow)])


def broken(some: Iterable[Case]) -> list[str]:
    """Cases that broke a promise, and how: the first 60."""
    faults = []
    for label, check in some:
        try:
            with deadline():
                check()
        except (Exception, Hang) as error:
            what = str(error).partition("\n")[0]  # without what pytest adds to an assertion
            faults.append(f"{label}: {type(error).__name__}: {what}"[:600])
    return faults[:60]


@contextlib.contextmanager
def deadline() -> Iterator[None]:
    """Raise `Hang` where the work takes too long; the timer of the whole test goes on after it."""
    begun, computed = time.monotonic(), time.process_time()

    def look(*_: object) -> None:
        waited, worked = time.monotonic() - begun, time.process_time() - computed
        if worked > DEADLINE or waited > LONGEST_WAIT:
            raise Hang(f"{worked:.0f} s of computing, {waited:.0f} s in all")
        signal.setitimer(signal.ITIMER_REAL, DEADLINE)

    handler = signal.signal(signal.SIGALRM, look)
    left, _ = signal.setitimer(signal.ITIMER_REAL, DEADLINE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)
        if left:
            rest = max(left - (time.monotonic() - begun), 0.01)
            signal.setitimer(signal.ITIMER_REAL, rest)


def command(*words: str) -> Answer:
    """The answer of the program to these words; what escapes from it escapes from here."""
    from smoskin.cli import main

    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = [signal.getsignal(number) for number in signals]
    given, code = sys.argv, 0
    sys.argv = ["smoskin", *words]
    out, err = (
        io.TextIOWrapper(io.BytesIO(), "utf-8", "replace", write_through=True) for _ in "oe"
    )
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                main()
            except SystemExit as end:
                if isinstance(end.code, str):
                    err.write(f"{end.code}\n")
                code = 1 if isinstance(end.code, str) else int(end.code or 0)
    finally:
        sys.argv = given
        for number, handler in zip(signals, handlers, strict=True):
            signal.signal(number, handler)
    texts = [stream.buffer.getvalue().decode("utf-8", "replace") for stream in (out, err)]
    return Answer(code, *texts)


def check_answer(answer: Answer, *, as_json: bool = False, names: str = "") -> None:
    """Assert that an answer is clean: JSON without gaps, or one bounded sentence with the name."""
    stderr = answer.err.strip()
    assert "Traceback" not in stderr, stderr
    assert "this is a bug" not in stderr, stderr
    assert "Warning" not in stderr, stderr
    lines = [line for line in stderr.splitlines() if not line.startswith("{")]  # no JSON
    last = lines[-1] if lines else ""
    assert len(last) <= LONGEST + len("error: "), f"{len(last)} characters: {last}"
    assert last.isprintable(), f"not printable: {last!r}"
    if answer.code == 0:
        assert not last.startswith("error:"), last
        for line in answer.out.splitlines() if as_json else ():
            strict_json(line)
        return
    assert answer.code in (1, 2), f"exit code {answer.code}: {last}"
    if answer.code == 2 or last.startswith("error:"):
        assert names in last, f"{names!r} is not named: {last}"
    assert last or answer.out, f"exit code {answer.code} without a word"


def check_error(error: SmoskinError, names: str = "") -> None:
    """Assert that a message is bounded, printable, and names its file."""
    message = str(error)
    assert message
    assert len(message) <= LONGEST, f"{len(message)} characters: {message}"
    assert message.isprintable(), f"not printable: {message!r}"
    assert names in message, f"{names!r} is not named: {message}"


def strict_json(text: str) -> object:
    """Value of a JSON text, in which NaN and infinity have no place."""

    def refuse(word: str) -> object:
        raise AssertionError(f"{word} in JSON: {text[:200]}")

    return json.loads(text, parse_constant=refuse)


@contextlib.contextmanager
def working_folder(folder: os.PathLike[str]) -> Iterator[None]:
    """A folder to work in, where names are short; bug reports are kept there too."""
    before, state = os.getcwd(), os.environ.get("XDG_STATE_HOME")
    os.chdir(folder)
    os.environ["XDG_STATE_HOME"] = os.fspath(folder)
    try:
        yield
    finally:
        os.chdir(before)
        os.environ.pop("XDG_STATE_HOME")
        if state is not None:
            os.environ["XDG_STATE_HOME"] = state


def mutated(raw: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """Bytes as a disk, a cable or a copy may leave them, and what was done to them."""
    size = len(raw)
    at, other = sorted(int(k) for k in rng.integers(0, size, 2))
    length = int(min(2 ** rng.integers(0, 12), size - at))
    piece, noise = raw[at : at + length], rng.bytes(length)
    bit = bytes([raw[at] ^ 1 << int(rng.integers(8))])
    several = bytearray(raw)
    for place in rng.integers(0, size, 8):
        several[place] = int(rng.integers(256))
    ways = {
        "bit flipped": raw[:at] + bit + raw[at + 1 :],
        "byte changed": raw[:at] + noise[:1] + raw[at + 1 :],
        "bytes changed": bytes(several),
        "end cut": raw[:at],
        "end nearly cut": raw[: size - 1 - int(rng.integers(0, min(64, size - 1)))],
        "beginning cut": raw[at:],
        "hole": raw[:at] + bytes(length) + raw[at + length :],
        "noise": raw[:at] + noise + raw[at + length :],
        "piece lost": raw[:at] + raw[at + length :],
        "piece doubled": raw[:at] + piece + raw[at:],
        "piece moved": raw[:at] + raw[at + length : other + length] + piece + raw[other + length :],
        "noise put in": raw[:at] + noise + raw[at:],
        "noise behind": raw + noise,
    }
    name = str(rng.choice(list(ways)))
    return f"{name} at {at} of {size}, {length} long", ways[name]


NUMBERS = ("nan", "inf", "-inf", "0", "-0.0", "-1", "1e308", "-1e308", "1e-308", "5e-324", "1e40")
"""Numbers that are none, or are too large or small for anything."""
TOML_VALUES = (
    *NUMBERS,
    *("1e999999999999999999", "1" * 5000, "0x7fffffffffffffffffff", "0.5", "7", "true", "[]", "{}"),
    *(
        "''",
        "'t'",
        f"'{'x' * 100_000}'",
        '"\\u001b[2J\\u0007"',
        "'ß\u202e'",
        "1979-05-27",
        "07:32:00",
    ),
    *("[3]", "['t', 't']", "[true, true]", "['+x']", "[[1, 2], [3, 4]]", "[0.2]", "[nan, 1, 1]"),
    *("[1000000, 1000000]", f"[{'1' * 30}, 1]", f"{'[' * 300}{']' * 300}", "{value = 1}"),
    *("{value = nan, origin = 'paper', reason = 'r'}", "{value = 1, origin = 3}", "[" * 20_000),
)
"""Values for any key of a TOML document."""


def changed_toml(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A TOML document in which a line is another, and what was done to it."""
    lines = text.splitlines()
    at = int(rng.choice([k for k, line in enumerate(lines) if line.strip()]))
    key, equals, value = lines[at].partition("=")
    way = int(rng.integers(8))
    if equals and way < 5:
        new = str(rng.choice(np.array(TOML_VALUES, dtype=object)))
        if "value =" in value and way < 3:  # within the table of value, origin and reason
            head, _, tail = value.partition("value =")
            new = f"{head}value = {new}, {tail.partition(',')[2]}"
        lines[at] = f"{key}= {new}"
        what = f"{key.strip()} = {new[:60].strip()}"
    elif way == 5:
        what = f"line {at + 1} lost: {lines.pop(at)[:60]}"
    elif way == 6:
        lines.insert(at, lines[at])
        what = f"line {at + 1} doubled"
    else:
        lines[at] = f"{key.strip()}_ {equals} {value}"
        what = f"line {at + 1} renamed: {lines[at][:60]}"
    return what, "\n".join(lines) + "\n"
