"""What commands share: the group they belong to, options that mean the same, tables and bars.

Decides how errors end the program: one line on standard error, without a traceback. Exit codes: 0
done, 1 the asked-for thing failed or was missed, 2 wrong use.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smoskin import __version__
from smoskin.errors import SmoskinError

if TYPE_CHECKING:
    from rich.table import Table

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Design, simulate, calibrate, train, run and see a sandwich Miura-ori tactile skin.",
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Design = Annotated[str, typer.Argument(help="A shipped design or the path of a TOML document.")]
Seconds = Annotated[float | None, typer.Option(min=0.0, help="Stop after so many seconds.")]
Record = Annotated[
    Path | None, typer.Option(help="Write everything to this new MCAP file.", dir_okay=False)
]


def main() -> None:
    """Run the command line; the console script's entry."""
    try:
        app()
    except SmoskinError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"smoskin {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options before any command."""


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error; called with what is being done and the share that is done."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(),
               TimeRemainingColumn())  # fmt: skip
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=1.0)

        def report(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        yield report


def show(table: "Table") -> None:
    """Print a table, wide enough for its columns where nobody's terminal limits it."""
    from rich.console import Console

    console = Console()
    Console(width=max(console.width, 100)).print(table)
