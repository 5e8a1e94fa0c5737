"""The command line as `python -m smoskin`."""

from smoskin.cli import main

main()
