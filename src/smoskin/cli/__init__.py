"""The command line: thin commands over `smoskin.commands`, each in the module of its theme."""

import sys

from smoskin.errors import MissingExtraError

try:
    from smoskin.cli.frame import app, main
except ImportError:
    sys.exit(f"error: {MissingExtraError('the command line', 'cli')}")

from smoskin.cli import calibration, live, optimise, score, skins, train

__all__ = ["app", "calibration", "live", "main", "optimise", "score", "skins", "train"]
