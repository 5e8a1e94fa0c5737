"""Command lines as people mistype them: refused in a sentence before any work, or taken."""

import contextlib
import itertools
import os
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fuzzing import NUMBERS, Began, broken, cases, check_answer, command, working_folder
from touch_recordings import record

WORDS = (
    *(
        "",
        " ",
        "x",
        "-",
        "--",
        "-1",
        "0",
        "1",
        "7",
        "0.5",
        "1e3",
        "1,5",
        "3x4",
        "0:1",
        "0:1:3",
        "yes",
    ),
    *("1:2:3:4", "0.1:1:1000000000", "100000x100000", "1" * 30, "9" * 5000, "1_0", "٣", "0x10"),
    *(
        "x" * 1000,
        "\x1b[2J",
        "a\nb",
        "ß\u202e",
        "\ud800",
        "../..",
        "~",
        "*",
        "nan,nan",
        "inf:inf:2",
    ),
    *("10,10", "45,80", "1e308,1e308", "0,0,-0.5", "0,0,-1e9", "nan,0,-1", "0,0", "0,1,2", "0,0,0"),
    *("planar", "optimised", "virtual", "virtual?seed=x", "twin://planar", "twin://", "replay:"),
    *("twin://planar?rate=0", "twin://planar?rate=1e308&speed=max", "replay:r.mcap?speed=nan"),
    *(
        "tcp://127.0.0.1:1",
        "sticking",
        "sliding:",
        "sliding:nan",
        "sliding:-1",
        "covered",
        "2026-13",
    ),
    *NUMBERS,
)
"""What may stand for any argument or value."""
INPUTS = ("missing", "folder", "empty", "noise", "text", "pipe", "/dev/zero", "/dev/full", "r.mcap")
INPUTS = (*INPUTS, "p.table", "n" * 300, "noise/below", "\udcff", "a\x1b[2Jb")
"""Files that cannot be read as what they should be, but for some."""
OUTPUTS = ("folder", "missing/o", "noise/o", "noise", "pipe", "/dev/full", "n" * 300, "", ".")
OUTPUTS = (*OUTPUTS, "a\x00b")
"""Outputs that must not be written."""
COMMANDS = {
    "info": ("DESIGN", "--json"),
    "check": ("FILE", "FILE", "DESIGN", "--json"),
    "new-design": ("mine", "mine", "--out=d.toml", "--out=", "--cells=", "--from=", "--force="),
    "simulate": (
        *("DESIGN", "--at=", "--force=", "--temperature=", "--manufactured", "--mechanics=reduced"),
        *("--mechanics=", "--grip=", "--seed=", "--json"),
    ),
    "sweep": (
        *("DESIGN", "--kind=grid", "--kind=random", "--kind=pairs", "--kind=shear", "--out="),
        *("--summary=", "--export=", "--forces=", "--drags=", "--directions=", "--places="),
        *("--count=", "--touches=", "--radius=", "--margin=", "--temperature=", "--skins="),
        *("--mechanics=", "--grip=", "--seed=", "--chunk=", "--workers=", "--json"),
    ),
    "table": ("DESIGN", "--out=", "--presses=", "--pairs=", "--skins=", "--seed=", "--workers="),
    "train": (
        *("p.table", "p.table", "FILE", "--out=", "--design=", "--chips=", "--drag=", "--members="),
        *("--minutes=", "--start=", "--resume", "--onnx=", "--plot=", "--seed=", "--json"),
    ),
    "score": (
        *("p.table", "p.table", "FILE", "--out=", "--design=", "--skins=", "--touches=", "--seed="),
        *("--places=", "--count=", "--drag=", "--pairs=", "--chips=", "--json"),
    ),
    "tessellate": (
        *("plane", "plane", "FILE", "--cells=", "--out=", "--design=", "--scale=", "--at="),
        *("--along=", "--time-limit=", "--force", "--json"),
    ),
    "optimise": (
        "--out=o.toml",
        "--out=",
        "DESIGN",
        "--minutes=",
        "--force=",
        "--rate=",
        "--seed=",
    ),
    "calibrate": (
        *("DESIGN", "--rig=", "--sheet=", "--recording=", "--touches=", "--until-mm=", "--force="),
        *("--drag=", "--place-mm=", "--force-mN=", "--table=", "--out=", "--json"),
    ),
    "touches plan": (
        *("DESIGN", "--out=", "--count=1", "--count=1", "--count=", "--until-mm=", "--force="),
        *("--drag=", "--place-mm=", "--force-mN=", "--after=", "--table=", "--json"),
    ),
    "fit-paper": (
        *("FILE", "--out=", "--design=", "--recording=", "--date=", "--separate", "--plot="),
        "--json",
    ),
    "virtual-bench": ("FILE", "--design=", "--seed=", "--sheet=", "--sheet=reduced"),
    "demo": (
        *("DESIGN", "--seconds=", "--headless", "--headless", "--json", "--port=", "--rate="),
        *("--seed=", "--touches=", "--table=", "--estimator=", "--record="),
    ),
    "run": (
        *("SOURCE", "--design=", "--calibration=", "--no-zero", "--seconds=0", "--seconds="),
        *("--record=", "--json"),
    ),
}
"""Commands with what they take; a value is put behind `=`."""
OUTPUT_OF = {
    "sweep": ("--count=3", "--kind=random", "--out="),
    "sweep export": ("--count=3", "--kind=random", "--out=s", "--export="),
    "table": ("--out=",),
    "train": ("p.table", "--out="),
    "train onnx": ("p.table", "--out=m", "--onnx="),
    "train plot": ("p.table", "--out=m", "--plot="),
    "score": ("p.table", "--out="),
    "optimise": ("--out=",),
    "calibrate": ("--out=",),
    "calibrate plot": ("--out=s.table", "--plot="),
    "touches plan": ("--count=1", "--out="),
    "fit-paper": ("full.csv", "--out="),
    "fit-paper plot": ("full.csv", "--out=c.toml", "--plot="),
    "virtual-bench": ("",),
    "new-design": ("mine", "--out="),
    "tessellate": ("plane", "--cells", "1", "1", "--out="),
    "demo": ("--headless", "--record="),
    "run": ("twin://planar?mechanics=reduced&speed=max", "--seconds=0", "--record="),
}
"""Commands with an output, its name left out at the end."""


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """A folder with files of all kinds, where work of minutes does not begin."""
    with working_folder(tmp_path):
        record(Path("r.mcap"), 5)
        assert command("virtual-bench", "full.csv", "--sheet", "reduced").code == 0
        Path("folder").mkdir()
        (Path("folder") / "kept").touch()
        Path("empty").touch()
        Path("noise").write_bytes(np.random.default_rng(1).bytes(5000))
        Path("text").write_text("hello = 3\n")
        shipped = Path(__file__).parents[2] / "src/smoskin/sensing/response/planar.table"
        Path("p.table").symlink_to(shipped)
        os.mkfifo("pipe")
        for name in (
            "smoskin.datasets.workers.Engine.run",
            "smoskin.mechanics.sheet.equilibrium.Equilibrium.relax",
            "smoskin.mechanics.sheet.tangent.Tangent.__init__",
            "smoskin.sensing.network.training.train_network",
            "smoskin.commands.fit_paper.judged_fit",
            "smoskin.commands.tessellate.tessellate",
        ):
            monkeypatch.setattr(name, begin)
        yield


def begin(*_: object, **__: object) -> None:
    """Stand for work of minutes."""
    raise Began


def answer(words: tuple[str, ...], *, as_json: bool = False) -> None:
    """A command line is refused in a sentence, or done, or its work begins."""
    kept = {name: Path(name).read_bytes() for name in ("noise", "text", "full.csv", "r.mcap")}
    with contextlib.suppress(Began):
        check_answer(command(*words), as_json=as_json)
    for name, content in kept.items():
        assert Path(name).read_bytes() == content, f"{name} was overwritten"
    assert Path("pipe").is_fifo()
    assert not list(Path().glob("*.part*"))


def filled(part: str, rng: np.random.Generator) -> str:
    """An argument with a value put in."""
    words = np.array(WORDS, dtype=object)
    if part == "DESIGN":
        return str(rng.choice(np.array([*INPUTS, "planar", "planar", "optimised"], dtype=object)))
    if part == "FILE":
        return str(rng.choice(np.array(INPUTS, dtype=object)))
    if part == "SOURCE":
        sources = [w for w in WORDS if ":" in w] + [f"replay:{name}?speed=max" for name in INPUTS]
        return str(rng.choice(np.array(sources, dtype=object)))
    if not part.endswith("="):
        return part
    files = ("out", "summary", "export", "record", "table", "sheet", "start", "onnx", "after")
    if part[2:-1] in (*files, "estimator", "calibration", "recording", "design", "plot"):
        words = np.array([*INPUTS, *OUTPUTS, "new"], dtype=object)
    return f"{part}{rng.choice(words)}"


@cases(20, 1600)
def test_every_command_line_is_refused_or_taken(count):
    def drawn():
        rng, names = np.random.default_rng(9), list(COMMANDS)
        for k in range(count):
            name = names[k % len(names)]
            some = rng.permutation(np.array(COMMANDS[name], dtype=object))[: rng.integers(1, 5)]
            words = (*name.split(), *(filled(part, rng) for part in some))
            label = " ".join(word[:60] for word in words)
            yield f"{k}: {label!r}", partial(answer, words, as_json="--json" in words)

    assert broken(drawn()) == []


def refused(words: tuple[str, ...]) -> None:
    """An output that cannot be written is refused before any work."""
    try:
        answer = command(*words)
    except Began:
        raise AssertionError("work began, whose output cannot be written") from None
    check_answer(answer)
    assert answer.code in (1, 2)


@pytest.mark.slow
def test_an_output_that_cannot_be_written_is_told_before_work_begins():
    def drawn():
        for (name, parts), output in itertools.product(OUTPUT_OF.items(), OUTPUTS):
            folders = ("sweep", "score", "tessellate")
            if name in folders and output in ("folder", "missing/o", ".", ""):
                continue  # which are folders, or can be made
            start = [word for word in name.split() if word not in ("export", "onnx", "plot")]
            words = (*start, *parts[:-1], parts[-1] + output)
            yield repr(" ".join(words)), partial(refused, words)

    assert broken(drawn()) == []
