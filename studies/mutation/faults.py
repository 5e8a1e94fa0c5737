"""Which faults a source file could carry: small changes, found on its syntax tree.

Decides the kinds of faults and the places that cannot matter: docstrings, annotations, messages,
arguments of decorators, switches that only guard against misuse, and signs under squares and norms.
Hides how a changed node is written back so that the rest of the file stays as it is.
"""

import ast
import copy
import difflib
import hashlib
import random
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

_OPERATORS: Final[Mapping[type, Sequence[type]]] = {
    ast.Add: [ast.Sub],
    ast.Sub: [ast.Add],
    ast.Mult: [ast.Div],
    ast.Div: [ast.Mult],
    ast.FloorDiv: [ast.Div],
    ast.Mod: [ast.FloorDiv],
    ast.Pow: [ast.Mult],
    ast.BitAnd: [ast.BitOr],
    ast.BitOr: [ast.BitAnd],
    ast.Lt: [ast.LtE, ast.Gt],
    ast.LtE: [ast.Lt, ast.GtE],
    ast.Gt: [ast.GtE, ast.Lt],
    ast.GtE: [ast.Gt, ast.LtE],
    ast.Eq: [ast.NotEq],
    ast.NotEq: [ast.Eq],
    ast.Is: [ast.IsNot],
    ast.IsNot: [ast.Is],
    ast.In: [ast.NotIn],
    ast.NotIn: [ast.In],
    ast.And: [ast.Or],
    ast.Or: [ast.And],
}
_NAMES: Final = {
    "mean": "sum",
    "sum": "mean",
    "median": "mean",
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "any": "all",
    "all": "any",
    "floor": "ceil",
    "ceil": "floor",
    "round": "floor",
    "sin": "cos",
    "cos": "sin",
    "isf": "ppf",
    "ppf": "isf",
    "var": "std",
    "std": "var",
}
"""Functions that may stand for others."""
_DROPPED: Final = {"sqrt", "abs", "square", "hypot", "exp", "log", "sorted", "clip", "radians"}
"""Functions whose first argument may stand in for the call."""
_SYMMETRIC: Final = {
    *("add", "multiply", "minimum", "maximum", "min", "max", "hypot", "isclose", "suppress"),
}
"""Functions whose arguments may be exchanged."""
_EVEN: Final = {"norm", "abs", "fabs", "hypot", "square", "cos", "cosh"}
"""Functions that give the same of a number and of its opposite."""
_HARMLESS: Final = {
    *("strict", "encoding", "exist_ok", "help", "hint", "name"),
    *("dtype", "out", "optimize", "overwrite_a", "maxsize"),
}
"""Keyword arguments that guard, explain, or save time and memory, and change no result."""
_LOOKS: Final = {
    *("anchor", "color", "flat_shading", "font_screen_scale", "intensity", "legend", "padding"),
    *("depth_test", "point_shape", "point_size", "show_axes", "thickness"),
    *("brand_color", "ground_color", "sky_color", "show_logo", "show_share_button"),
}
"""Keyword arguments of what is drawn: no number depends on them, eyes judge them on pictures."""
_MESSAGES: Final = (ast.Raise, ast.JoinedStr, ast.Assert)
_ANNOTATIONS: Final = ("annotation", "returns", "decorator_list", "bases", "type_params")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One change of one source file."""

    path: str
    """The file, relative to the root of the project."""
    line: int
    """Line of the change, from 1."""
    kind: str
    """What was changed: arithmetic, comparison, constant, term, argument ..."""
    span: tuple[int, int]
    """First byte that is replaced, and the first one that stays again."""
    written: str
    """What stands there instead."""

    def key_in(self, source: str) -> str:
        """Name of the change of this text, the same in every run; another once the text differs."""
        return hashlib.sha256(f"{self.path}\n{self.applied(source)}".encode()).hexdigest()[:16]

    def applied(self, source: str) -> str:
        """The file's text with the fault in it."""
        text, (start, end) = source.encode(), self.span
        return (text[:start] + self.written.encode() + text[end:]).decode()

    def diff(self, source: str) -> str:
        """The change of the file's text as a unified diff without context."""
        before, after = source.splitlines(), self.applied(source).splitlines()
        lines = difflib.unified_diff(before, after, n=0, lineterm="")
        return "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))


def faults_in(path: str, source: str, *, messages: bool = False) -> list[Fault]:
    r"""Every fault that a file could carry, some of which may not compile.

    Parameters
    ----------
    path : str
        The file's name in the faults.
    source : str
        Its text.
    messages : bool, optional
        Whether texts of errors and outputs are changed too.

    Examples
    --------
    >>> source = "def half(x):\n    return x / 2\n"
    >>> for fault in faults_in("a.py", source):
    ...     print(fault.kind, fault.diff(source).splitlines()[-1])
    arithmetic +    return (x * 2)
    factor +    return (2 * (x / 2))
    sign +    return (-(x / 2))
    term +    return x
    exchange +    return (2 / x)
    constant +    return x / 3
    constant +    return x / 1
    """
    # Columns of syntax trees count bytes.
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    faults = {}
    for node, kind, written in _changes(ast.parse(source), messages):
        start = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        fault = Fault(path=path, line=node.lineno, kind=kind, span=(start, end), written=written)
        faults[fault.span, fault.written] = fault
    return list(faults.values())


def draw(
    root: Path, files: Iterable[str], count: int, *, seed: int = 0, messages: bool = False
) -> list[Fault]:
    """Faults at lines chosen at random, at most one a line, the same for the same seed.

    Parameters
    ----------
    root : Path
        The project's folder.
    files : iterable of str
        Where faults may be, relative to the root.
    count : int
        How many; fewer where the files have fewer lines that matter.
    seed : int, optional
    messages : bool, optional
        As for `faults_in`.
    """
    sources = {path: (root / path).read_text("utf-8") for path in sorted(files)}
    lines: dict[tuple[str, int], list[Fault]] = {}
    for path, source in sources.items():
        for fault in faults_in(path, source, messages=messages):
            lines.setdefault((path, fault.line), []).append(fault)
    rng = random.Random(seed)
    drawn: list[Fault] = []
    for path, line in rng.sample(sorted(lines), len(lines)):
        # The kind first: a line with many numbers would otherwise seldom change anything else.
        kind = rng.choice(sorted({fault.kind for fault in lines[path, line]}))
        fault = rng.choice([fault for fault in lines[path, line] if fault.kind == kind])
        if len(drawn) < count and _compiles(fault.applied(sources[path])):
            drawn.append(fault)
    return drawn


def _compiles(source: str) -> bool:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            compile(source, "fault", "exec")
    except (SyntaxError, ValueError):
        return False
    return True


def _changes(tree: ast.AST, messages: bool) -> Iterator[tuple[Any, str, str]]:
    """Nodes, the kind of the change, and what is written in a node's place."""
    even = {id(part) for node in ast.walk(tree) for part in _squared(node)}
    for node in _nodes(tree, messages):
        if isinstance(node, ast.stmt):
            yield from _statements(node)
        elif isinstance(node, ast.expr):
            for kind, changed in _expressions(node, messages):
                text = ast.unparse(changed)
                if text == ast.unparse(node):  # exchanged arguments may be the same
                    continue
                if id(node) in even and _is_opposite(node, kind):
                    continue
                plain = isinstance(changed, ast.Constant | ast.Name | ast.Attribute | ast.Call)
                yield node, kind, text if plain else f"({text})"


def _squared(node: ast.AST) -> list[ast.expr]:
    """Expressions of which only the size counts here, to the last bit."""
    match node:
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=2 | 4)):
            return [base]
        case ast.Call(func=ast.Attribute(attr=name) | ast.Name(id=name)) if name in _EVEN:
            return node.args[: 2 if name == "hypot" else 1]
    return []


def _is_opposite(node: ast.expr, kind: str) -> bool:
    """Whether a change of this kind gives the opposite of what an expression gave."""
    difference = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub)
    return kind == "sign" or (kind == "exchange" and difference)


def _nodes(node: ast.AST, messages: bool) -> Iterator[ast.AST]:
    """Nodes whose change may matter."""
    for name, value in ast.iter_fields(node):
        if name in _ANNOTATIONS:
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or _is_harmless(child, messages):
                continue
            yield child
            # Parts of a formatted string have no places of their own before Python 3.12.
            if not isinstance(child, ast.JoinedStr):
                yield from _nodes(child, messages)


def _is_harmless(node: ast.AST, messages: bool) -> bool:
    if isinstance(node, _MESSAGES) and not messages:
        return not (isinstance(node, ast.Raise) and "Exit" in ast.unparse(node))
    if isinstance(node, ast.keyword):
        return node.arg in _HARMLESS | _LOOKS
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return True
    if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
        return True
    if isinstance(node, ast.AnnAssign) and node.value is not None and _is_color(node.value):
        return True
    return _is_docstring(node)


def _is_color(node: ast.expr) -> bool:
    """Whether a constant is a colour: three whole numbers of 8 bits, which eyes judge."""
    numbers = ast.literal_eval(node) if isinstance(node, ast.Tuple) and _is_plain(node) else ()
    return len(numbers) == 3 and all(type(n) is int and 0 <= n < 256 for n in numbers)


def _is_plain(node: ast.Tuple) -> bool:
    return all(isinstance(part, ast.Constant) for part in node.elts)


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _statements(node: ast.stmt) -> Iterator[tuple[ast.AST, str, str]]:
    """Statements left out, guards that never hold, loops that end otherwise."""
    target = node.targets[0] if isinstance(node, ast.Assign) else node
    if isinstance(target, ast.Expr | ast.AugAssign | ast.Delete | ast.Attribute | ast.Subscript):
        yield node, "statement", "pass"
    elif isinstance(node, ast.If) and isinstance(node.body[-1], ast.Raise | ast.Return):
        yield node.test, "guard", "False"
    elif isinstance(node, ast.Break):
        yield node, "loop", "continue"
    elif isinstance(node, ast.Continue):
        yield node, "loop", "break"


def _expressions(node: ast.expr, messages: bool) -> Iterator[tuple[str, ast.expr]]:
    match node:
        case ast.BinOp():
            yield from _sums(node)
        case ast.Compare(ops=ops):
            for k, operator in enumerate(ops):
                for other in _OPERATORS.get(type(operator), ()):
                    yield "comparison", _with(node, ops=[*ops[:k], other(), *ops[k + 1 :]])
            yield "not", ast.UnaryOp(ast.Not(), node)
        case ast.BoolOp(op=operator, values=values):
            yield "boolean", _with(node, op=_OPERATORS[type(operator)][0]())
            for k in range(len(values)):
                rest = [*values[:k], *values[k + 1 :]]
                yield "boolean", rest[0] if len(rest) == 1 else _with(node, values=rest)
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert(), operand=operand):
            yield ("sign" if isinstance(node.op, ast.USub) else "not"), operand
        case ast.Constant(value=value):
            for number in _constants(value, messages):
                yield "constant", ast.Constant(number)
        case ast.IfExp(test=test, body=body, orelse=orelse):
            yield "condition", _with(node, test=ast.UnaryOp(ast.Not(), test))
            yield "condition", body
            yield "condition", orelse
        case ast.Call():
            yield from _calls(node)
        case ast.Attribute(value=value, attr="T"):
            yield "axis", value
        case ast.JoinedStr() if messages:
            yield "message", ast.Constant("")


def _sums(node: ast.BinOp) -> Iterator[tuple[str, ast.expr]]:
    """Sums and products: another operator, sign or factor, a term less, sides exchanged."""
    if any(
        isinstance(side, ast.JoinedStr | ast.List | ast.Tuple) for side in (node.left, node.right)
    ):
        return
    for other in _OPERATORS.get(type(node.op), ()):
        yield "arithmetic", _with(node, op=other())
    if isinstance(node.op, ast.BitAnd | ast.BitOr):
        yield "term", node.left
        yield "term", node.right
        return
    yield "factor", ast.BinOp(ast.Constant(2), ast.Mult(), node)
    yield "sign", ast.UnaryOp(ast.USub(), node)
    yield "term", node.left
    if isinstance(node.op, ast.Add | ast.Mult | ast.MatMult):
        yield "term", node.right
    if isinstance(node.op, ast.Sub | ast.Div | ast.MatMult):
        yield "exchange", _with(node, left=node.right, right=node.left)


def _constants(value: object, messages: bool) -> Iterator[str | float]:
    """Numbers one off or twice and half as large; switches the other way round."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield value + 1
        yield value - 1
    elif isinstance(value, float):
        yield from (value * 2, value / 2) if value else (1.0,)
    elif isinstance(value, str) and value and messages:
        yield ""


def _calls(node: ast.Call) -> Iterator[tuple[str, ast.expr]]:
    """Calls of another function, with arguments exchanged, with one less, or left out."""
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    if name in _NAMES:
        slot = "attr" if isinstance(node.func, ast.Attribute) else "id"
        yield "function", _with(node, func=_with(node.func, **{slot: _NAMES[name]}))
    if name in _DROPPED and node.args:
        yield "function", node.args[0]
    if name in ("Exit", "exit"):
        code = 0 if node.args else 1
        yield "exit", _with(node, args=[ast.Constant(code)])
    for k in range(len(node.args) - 1):
        pair = node.args[k : k + 2]
        starred = any(isinstance(part, ast.Starred | ast.GeneratorExp) for part in pair)
        if name not in _SYMMETRIC and not starred:
            yield "exchange", _with(node, args=[*node.args[:k], *pair[::-1], *node.args[k + 2 :]])
    for k, keyword in enumerate(node.keywords):
        before, after = node.keywords[:k], node.keywords[k + 1 :]
        # All arguments of a record are needed: without one it cannot be made.
        if keyword.arg and keyword.arg not in _HARMLESS | _LOOKS and not name[:1].isupper():
            yield "argument", _with(node, keywords=[*before, *after])
        if keyword.arg == "axis" and isinstance(keyword.value, ast.Constant | ast.UnaryOp):
            value = ast.unparse(keyword.value)
            axis = _with(keyword, value=ast.Constant(1 if value == "0" else 0))
            yield "axis", _with(node, keywords=[*before, axis, *after])


def _with(node: Any, **parts: Any) -> Any:
    """The same node but for some of its parts."""
    changed = copy.copy(node)
    for name, value in parts.items():
        setattr(changed, name, value)
    return changed
