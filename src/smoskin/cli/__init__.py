"""The command line: thin commands over `smoskin.commands`, each in the module of its theme.

Decides that signals are heard before anything is imported that takes long, and that what JAX
compiles is kept in the user's cache folder, so that a second run starts at once.
"""

import os
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from smoskin.cli.ending import heed_signals, run_to_end
from smoskin.errors import MissingExtraError

if TYPE_CHECKING:
    import typer


def main() -> None:
    """Run the command line; the console script's entry."""
    begun = time.monotonic()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # what a terminal cannot show must not end the program
            stream.reconfigure(errors="replace")
    sys.exit(run_to_end(partial(_run, begun)))


def _run(begun: float) -> None:
    """Run a command, told when the program began; signals are heard from here on."""
    heed_signals()
    app = _app()
    keep_compiled()
    app(prog_name="smoskin", obj=begun)


def keep_compiled() -> None:
    """Let JAX keep what it compiles in the user's cache folder, unless told otherwise."""
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(home) / "smoskin" / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # without a place to keep it, it is compiled anew each time
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder)
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")


def _app() -> "typer.Typer":
    """All commands, of every theme."""
    try:
        from smoskin.cli.frame import app
    except ImportError as error:
        raise MissingExtraError("the command line", "cli") from error
    from smoskin.cli import (  # noqa: F401
        calibration,
        fabricate,
        files,
        live,
        optimise,
        rig,
        robots,
        score,
        skins,
        tessellate,
        train,
    )

    return app


def __getattr__(name: str) -> object:
    """`app`, all commands."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _app()
