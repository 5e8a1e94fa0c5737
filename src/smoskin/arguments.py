"""Arguments of public functions and records against their annotations.

Decides which values an annotation admits, and how a wrong one is named; hides how annotations are
read. What an annotation cannot say (a range, the shape of an array) is checked where it is known.
Beartype would be faster; it takes True for a number but no number of NumPy's, and its messages name
type hints.
"""

import os
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial, wraps
from inspect import signature
from itertools import chain
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np

from smoskin.errors import ArgumentError, SmoskinError

Wrapped = TypeVar("Wrapped", bound=Callable[..., Any])

Seed: TypeAlias = Annotated[int, "seed"]
"""What a generator of random numbers begins with: a whole number that is not negative."""


class _Kind(NamedTuple):
    """Values that an annotation admits."""

    words: str
    admits: Callable[[object], bool]


def typed(function: Wrapped, error: type[SmoskinError] = ArgumentError) -> Wrapped:
    """The function, or the record with its constructor, that refuses what no annotation admits.

    An argument that is none of its annotation's raises the error by name; annotations of arrays,
    and those that only type checkers can read, admit all. A name that is missing or unknown stays a
    `TypeError`.

    Examples
    --------
    >>> @typed
    ... def press(force: float, times: int | None = None) -> None: ...
    >>> press(0.5, times="3")
    Traceback (most recent call last):
    smoskin.errors.ArgumentError: times must be a whole number or None; got '3'
    """
    if isinstance(function, type):
        function.__init__ = typed(function.__init__, error)  # type: ignore[misc]
        return function
    names = tuple(signature(function).parameters)
    given = getattr(function, "__annotations__", {})
    scope = getattr(function, "__globals__", {})
    kinds: dict[str, _Kind] = {}

    @wraps(function)
    def checked(*args: Any, **more: Any) -> Any:
        if not kinds:
            kinds.update({name: _kind(given.get(name, Any), scope) for name in names})
        for name, value in chain(zip(names, args, strict=False), more.items()):
            kind = kinds.get(name, _ANYTHING)
            if not kind.admits(value):
                raise error(f"{name} must be {kind.words}; got {value!r:.100}")
        return function(*args, **more)

    return cast(Wrapped, checked)


def _number(value: object) -> bool:
    """Whether this is one real number that a float can hold."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "fiu"
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _whole(value: object) -> bool:
    """Whether this is a whole number of an array."""
    return isinstance(value, Integral) and not isinstance(value, bool) and abs(int(value)) < 2**63


def _several(value: object, kinds: Sequence[_Kind], *, fixed: bool = False) -> bool:
    """Whether this is a sequence of such things: of so many, or of any number of the one kind."""
    if isinstance(value, str | bytes) or not isinstance(value, Sequence | np.ndarray):
        return False
    if isinstance(value, np.ndarray) and value.ndim != 1:
        return False
    each = kinds if fixed else [kinds[0]] * len(value)
    return len(value) == len(each) and all(
        kind.admits(item) for kind, item in zip(each, value, strict=True)
    )


_ANYTHING: Final = _Kind("anything", lambda value: True)
_PLAIN: Final[Mapping[object, _Kind]] = {
    float: _Kind("a number", _number),
    int: _Kind("a whole number", _whole),
    bool: _Kind("True or False", lambda value: isinstance(value, bool | np.bool_)),
    str: _Kind("a text", lambda value: isinstance(value, str)),
    NoneType: _Kind("None", lambda value: value is None),
    os.PathLike: _Kind("a path", lambda value: isinstance(value, os.PathLike)),
    Callable: _Kind("a function", callable),
}


def _kind(hint: Any, scope: Mapping[str, Any]) -> _Kind:
    """What a hint admits; names in one that is a text are those of this scope."""
    if isinstance(hint, str):
        try:
            hint = eval(hint, dict(scope))
        except NameError:
            return _ANYTHING
    origin = typing.get_origin(hint) or hint
    parts = [_kind(part, scope) for part in _parts(hint, origin)]
    if origin in (typing.Union, UnionType):
        if _ANYTHING in parts:
            return _ANYTHING
        words = dict.fromkeys(part.words for part in parts)
        return _Kind(" or ".join(words), lambda value: any(part.admits(value) for part in parts))
    if hint == Seed:
        return _Kind("a whole number >= 0", lambda value: _whole(value) and value >= 0)  # type: ignore[operator]
    if origin is Literal:
        allowed = typing.get_args(hint)
        return _Kind(" or ".join(map(repr, allowed)), lambda value: _among(value, allowed))
    if (plain := _PLAIN.get(origin)) is not None:
        return plain
    opaque = hint is Any or not isinstance(origin, type) or getattr(origin, "_is_protocol", False)
    if opaque or issubclass(origin, np.ndarray):
        return _ANYTHING
    if issubclass(origin, os.PathLike):
        return _PLAIN[os.PathLike]
    if parts and origin in (Sequence, tuple, list):
        fixed = origin is tuple and Ellipsis not in typing.get_args(hint)
        each = ", ".join(part.words for part in parts)
        text = f"({each})" if fixed else f"a sequence, each {each}"
        return _Kind(text, partial(_several, kinds=parts, fixed=fixed))
    if origin is Iterable:
        return _Kind("something to iterate over", lambda value: isinstance(value, Iterable))
    article = "an" if origin.__name__[0] in "AEIOU" else "a"
    return _Kind(f"{article} {origin.__name__}", lambda value: isinstance(value, origin))


def _parts(hint: Any, origin: Any) -> list[Any]:
    """Hints inside one, of those whose insides count."""
    inside = origin in (typing.Union, UnionType, Sequence, tuple, list)
    return [part for part in typing.get_args(hint) if part is not Ellipsis] if inside else []


def _among(value: object, allowed: Sequence[object]) -> bool:
    return isinstance(value, str | int | float | NoneType) and value in allowed
