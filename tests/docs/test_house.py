"""The shape of the package: small files, small folders, and nothing that only tests use."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "smoskin"
FILES = {path: path.read_text(encoding="utf-8") for path in sorted(SOURCE.rglob("*.py"))}
ENTRIES = ("smoskin", "smoskin.__main__", "smoskin.plots")
"""Modules that people import or run themselves."""


def module(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(text: str) -> set[str]:
    """Modules that a file may import, with those that it names in strings for lazy imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value)
    return names


def code_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function without its docstring."""
    lines = (node.end_lineno or 0) - node.lineno + 1
    if ast.get_docstring(node) is None:
        return lines
    first = node.body[0]
    return lines - ((first.end_lineno or 0) - first.lineno + 1)


def test_the_wheel_stays_one_that_can_be_read_in_a_week():
    # 24,000 lines held all that skins are made, judged and read with; 3,910 more keep bad sheets,
    # wrong arguments, damaged files, failing chips and visitors of the page from going wrong in
    # silence; 1,500 are laws of contact and worlds to be judged in;
    # 180 keep time and show what is missed; 374 learn a skin's law of contact;
    # 3,000 lay sheets on surfaces, unfold them and judge what was found;
    # 3,990 read chips and boards, look after them, learn from one's own touches, exchange tables;
    # 500 follow the zero of a skin that turns; 280 learn and undo hysteresis; 95 make
    # signals linear in motion;
    # 1,360 bend columns under load, stop them and tilt the board;
    # 4,090 draw patterns, moulds and the process sheet of a workshop;
    # 2,610 lay out its boards, check them and write what a board house needs;
    # 70 judge learned models by touches of other days and runs; 88 train networks for arms;
    # 215 judge crease patterns of any program;
    # 345 bend a skin round a limb: places, axes, the shell on its pillars, and the page;
    # 108 let all starts of a search for touches go on together; 85 bound what one could say of two;
    # 370 show a tessellated sheet from flat to attached, report on it and give its design;
    # 110 try other weights where a sheet does not lie on its surface;
    # 260 write the assembled skin as STEP; 215 put guided covers in place of scales;
    # 740 roll a skin's parts on to its limb, make what it takes besides, and cast pillars;
    # 220 write recordings as episodes for robot learning; 1,000 press real skins by a stage and
    # a gauge; 600 keep a rig's campaign in one recording and touch virtual skins slowly;
    # 2,295 let an arm yield to touch: its joints, the law, what stops it, a simulated one, poses;
    # 1,180 characterise a skin from such recordings and put their streams on one rate;
    # 60 hear a loud arm and pool chips' loops;
    # 110 draw a skin's columns and its magnets' sectors on the live page;
    # 7,700 are bridges to robotics tools, real arms, campaigns of many kinds and cones;
    # 130 learn how a skin turns, ask what of a patch is covered, and send skins back;
    # 170 choose a sheet's plates and direction, and say what a refused surface asks too much of;
    # 500 judge every limit of an arm that yields, record what it followed, and let touches rest;
    # 100 examine pairs in turn, and spend less on a reading of a board and of a touch.
    assert sum(text.count("\n") for text in FILES.values()) <= 63_500


def test_no_file_has_over_450_lines():
    assert {module(p): n for p, t in FILES.items() if (n := t.count("\n")) > 450} == {}


def test_no_folder_has_over_14_files():
    folders = [path.parent for path in FILES]
    assert {str(folder): n for folder in set(folders) if (n := folders.count(folder)) > 14} == {}


def test_few_functions_have_over_50_lines():
    long = [
        f"{module(path)}.{node.name}: {lines}"
        for path, text in FILES.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (lines := code_lines(node)) > 50
    ]
    assert len(long) <= 5, long


def test_frozen_records_are_filled_in_one_place():
    places = [module(p) for p, text in FILES.items() if "object.__setattr__" in text]
    assert places == ["smoskin.arrays"]


def test_the_formatter_is_hardly_ever_switched_off():
    assert sum(text.count("fmt: skip") for text in FILES.values()) <= 10


def test_every_module_is_used_by_the_package():
    used = {name for text in FILES.values() for name in imported(text)}
    unused = [
        name
        for path in FILES
        if path.name != "__init__.py" and (name := module(path)) not in used | set(ENTRIES)
    ]
    assert unused == []


def test_the_package_stands_alone():
    outside = [
        f"{module(path)}: {name}"
        for path, text in FILES.items()
        for name in imported(text)
        if name.split(".")[0] in ("paper", "studies", "tests")
    ]
    assert outside == []


def loaded(body: list[ast.stmt]) -> set[str]:
    """Modules that must be there before a file's own names are: not those of its functions."""
    names: set[str] = set()
    for node in body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            names |= imported(ast.unparse(node))
        elif isinstance(node, ast.Try):
            names |= loaded(node.body) | loaded([s for h in node.handlers for s in h.body])
        elif isinstance(node, ast.If) and "TYPE_CHECKING" not in ast.unparse(node.test):
            names |= loaded(node.body) | loaded(node.orelse)
    return names


def test_no_two_modules_wait_for_each_other():
    waits = {module(p): loaded(ast.parse(text).body) - {module(p)} for p, text in FILES.items()}
    waits = {name: needs & set(waits) for name, needs in waits.items()}
    while free := [name for name, needs in waits.items() if not needs]:
        for name in free:
            del waits[name]
        waits = {name: needs - set(free) for name, needs in waits.items()}
    assert sorted(waits) == []
