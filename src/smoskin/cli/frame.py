"""What commands share: the help that groups them, options that mean the same, tables and bars."""

import json
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Protocol

import typer
from typer import Argument, Option
from typer.core import TyperGroup

from smoskin import __version__
from smoskin.errors import one_line
from smoskin.roles import Progress

if TYPE_CHECKING:
    from rich.table import Table

_UsageError: Final[type[typer.BadParameter]] = typer.BadParameter.__base__  # type: ignore[assignment]
"""click's, which typer does not name: it may carry a click of its own."""
_EVERY: Final = 5.0
"""s between lines of progress where there is no terminal."""
_GROUPS: Final = {
    "See and read a skin": ("demo", "run", "view", "info", "check", "convert", "doctor", "board"),
    "Calibrate a skin": ("calibrate", "touches", "report", "fit-paper", "virtual-bench"),
    "Simulate": ("simulate", "sweep", "table"),
    "Train, judge, design": ("train", "learn", "score", "optimise", "new-design", "tessellate"),
    "Build": ("fabricate",),
    "Robots and other programs": ("serve", "ros", "follow"),
}
"""Commands by what they are for, in the order of the help."""


class GroupedCommands(TyperGroup):
    """A command line whose help lists the commands by what they are for.

    Contexts and formatters are those of click, which typer either needs or brings along.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """Let the log be asked for behind a command too."""
        asked = [arg for arg in args if arg in ("-v", "--verbose")]
        return super().parse_args(ctx, [*asked[:1], *(arg for arg in args if arg not in asked)])

    def invoke(self, ctx: Any) -> Any:
        """Run a command; what a refused argument repeats of itself is cut."""
        try:
            return super().invoke(ctx)
        except _UsageError as error:
            error.message = one_line(error.message, 200)
            raise

    def list_commands(self, ctx: Any) -> list[str]:
        """Names in the order of the help; a command that is in no group comes last."""
        ordered = [name for names in _GROUPS.values() for name in names]
        return sorted(self.commands, key=[*ordered, *self.commands].index)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each group under its heading, every command with its first sentence."""
        names = self.list_commands(ctx)
        room = formatter.width - max(map(len, names)) - 6
        texts = {name: self.commands[name].get_short_help_str(2 * room) for name in names}
        for heading, group in {**_GROUPS, "Other": names}.items():
            rows = [(name, texts.pop(name)) for name in group if name in texts]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)


app = typer.Typer(
    cls=GroupedCommands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Design, simulate, calibrate, train, run and see a sandwich Miura-ori tactile skin.",
)

File = Path | None
Number = float | None
Text = str | None
Whole = int | None
"""Values of options that may be left out."""

Carried = Annotated[bool, Option("--arm", help="An arm turns the skin: its weight moves it.")]
Json = Annotated[bool, Option("--json", help="Print JSON for machines.")]
Force = Annotated[bool, Option("--force", help="Replace files that exist already.")]
Design = Annotated[str, Argument(help="A shipped design or the path of a TOML document.")]


def examples(*lines: str) -> str:
    """The end of a command's help: command lines to start from."""
    return "\b\nExamples:\n" + "\n".join(f"  smoskin {line}" for line in lines)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"smoskin {__version__}")
        raise typer.Exit


def _verbose(asked: bool) -> None:
    """Log what the package does, on standard error."""
    if asked:
        logging.basicConfig(format="%(name)s: %(message)s")
        logging.getLogger("smoskin").setLevel(logging.INFO)


Version = Option("--version", callback=_version, help="Print the version.")
Verbose = Option("--verbose", "-v", callback=_verbose, help="Log files, seeds, rates, drops.")


@app.callback()
def _options(
    version: Annotated[bool, Version] = False, verbose: Annotated[bool, Verbose] = False
) -> None:
    """Options before any command."""


def clock_of(context: typer.Context) -> Callable[[], float]:
    """The seconds since the program began, imports included."""
    begun = time.monotonic() if context.obj is None else float(context.obj)
    return lambda: time.monotonic() - begun


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A listener that shows progress on standard error.

    It is a bar on a terminal, elsewhere a line every 5 s, as a log or a notebook can hold.
    """
    from rich.console import Console
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _ProgressLines(time.monotonic)
        return
    with Bar(console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


class _ProgressLines:
    """Tells of work on standard error, at most once in `_EVERY` seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._begin = self._printed = clock()

    def __call__(self, what: str, share: float) -> None:
        """Tell what is being done and the share that is done, if it is time to."""
        now = self._clock()
        if now - self._printed >= _EVERY:
            self._printed = now
            typer.echo(f"{now - self._begin:5.0f} s {100 * share:4.0f} %  {what}", err=True)


class Report(Protocol):
    """What a command has to say, for machines and for people."""

    def as_json(self) -> dict[str, Any]:
        """Plain values."""

    def tables(self) -> "Sequence[Table]":
        """The same in tables."""


def tell(report: Report, as_json: bool, **more: object) -> None:
    """Print a report, as JSON with these keys more or as tables."""
    if as_json:
        typer.echo(json.dumps(report.as_json() | more))
        return
    for table in report.tables():
        show(table)


def show(table: "Table") -> None:
    """Print a table, wide enough for its columns where nobody's terminal limits it."""
    from rich.console import Console

    console = Console()
    Console(width=max(console.width, 100)).print(table)
