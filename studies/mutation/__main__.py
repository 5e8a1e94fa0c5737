"""``python -m studies.mutation``: which faults, seeded at random, do the tests not notice."""

import json
import os
import tempfile
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from smoskin.errors import SmoskinError
from studies.mutation.faults import Fault, draw
from studies.mutation.trials import Judgement, Tier, as_json, judge_all, sources

_ROOT = Path(__file__).parents[2]


def main(
    room: Annotated[
        list[str] | None,
        typer.Option(help="A folder or module below src/smoskin; repeat for several."),
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="How many faults.")] = 40,
    seed: Annotated[int, typer.Option(help="Seed of the random choice.")] = 0,
    tier: Annotated[Tier, typer.Option(help="The widest circle of tests to run.")] = "default",
    workers: Annotated[int, typer.Option(min=1, help="Faults judged at a time.")] = 1,
    deadline: Annotated[float, typer.Option(help="Seconds that one tier may take.")] = 900.0,
    messages: Annotated[bool, typer.Option(help="Change texts of messages too.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="A JSON file of the judgements; those in it are not made again."),
    ] = None,
    only_list: Annotated[
        bool, typer.Option("--list", help="Show the faults; run no test.")
    ] = False,
) -> None:
    """Seed faults at random, one at a time, and tell which of them no test notices.

    Works on copies; nothing in the project changes. Ends with code 1 where a fault survived.
    """
    rooms = room or ["sensing", "mechanics", "service", "cli"]
    faults = draw(_ROOT, sources(_ROOT, rooms), count, seed=seed, messages=messages)
    if only_list:
        for fault in faults:
            text = (_ROOT / fault.path).read_text("utf-8")
            typer.echo(f"{fault.path}:{fault.line} {fault.kind}\n{fault.diff(text)}")
        return
    judged = _read(out)

    def note(judgement: Judgement, fault: Fault) -> None:
        judged[_key(fault)] = judgement
        typer.echo(judgement.text)
        if out is not None:
            _write(out, judged)

    # A survivor of fewer tests, or of too little time, is judged again.
    waiting = [fault for fault in faults if not _is_settled(judged.get(_key(fault)), tier)]
    judge_all(_ROOT, waiting, workers=workers, deadline=deadline, last=tier, progress=note)
    counts = Counter(judged[_key(fault)].outcome for fault in faults)
    typer.echo(f"{len(faults)} faults: " + ", ".join(f"{n} {name}" for name, n in counts.items()))
    if counts["killed"] < len(faults):
        raise typer.Exit(1)


def _key(fault: Fault) -> str:
    """Name of a fault that changes when its file does."""
    return fault.key_in((_ROOT / fault.path).read_text("utf-8"))


def _is_settled(judgement: Judgement | None, tier: Tier) -> bool:
    """Whether judging once more would tell nothing new."""
    if judgement is None:
        return False
    return judgement.outcome == "killed" or judgement.tier in ("default", tier)


def _read(out: Path | None) -> dict[str, Judgement]:
    """Judgements of an earlier run; none where there is no file."""
    if out is None or not out.exists():
        return {}
    return {key: Judgement(**plain) for key, plain in json.loads(out.read_text("utf-8")).items()}


def _write(out: Path, judged: dict[str, Judgement]) -> None:
    """Write all judgements; a run that is cut off leaves the file as it was."""
    with tempfile.NamedTemporaryFile("w", dir=out.parent, delete=False, encoding="utf-8") as file:
        json.dump(as_json(judged), file, indent=1)
    os.replace(file.name, out)


if __name__ == "__main__":
    try:
        typer.run(main)
    except SmoskinError as error:
        raise SystemExit(f"error: {error}") from error
