"""Files of what was learned: arrays, and what they mean as JSON in the file's header.

Decides how such a file is written and which is refused; what stands in it is its owner's. The
format is safetensors, which carries no code.
"""

import hashlib
import json
import logging
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smoskin.arrays import floats, freeze
from smoskin.errors import ArgumentError, ModelError, SmoskinError, require
from smoskin.outputs import read_input, write_output

_LOG: Final = logging.getLogger(__name__)
RESPONSE_TABLE: Final = "smoskin_response_table"
NETWORK: Final = "smoskin_network"
"""Keys of the kinds that programs tell apart by `tensor_key`."""

_SUM: Final = "sha256"
"""Key of the checksum in the header; files of earlier versions have none."""
_LARGEST: Final = 2**30
"""Largest file that is read, bytes."""
_DAMAGE: Final = (
    ArithmeticError,
    AttributeError,
    IndexError,
    KeyError,
    RecursionError,
    TypeError,
    ValueError,
)
"""Errors that a description raises which is not what was written."""

_Content = TypeVar("_Content")
Limits: TypeAlias = Mapping[str, tuple[ArrayLike, ArrayLike]]
"""Least and largest value of numbers and arrays, by the name of their field."""


class TensorFile(NamedTuple):
    """A kind of file."""

    kind: str
    """What people call it, with its article."""
    key: str
    """Key of the header in the file."""
    format: int
    """The version that is written."""
    older: tuple[int, ...] = ()
    """Earlier versions that are read as well."""

    def check_writer(self) -> None:
        """Raise `MissingExtraError` unless the library that writes such files is installed."""
        require(f"writing {self.kind}", "learned", "safetensors")

    def write(
        self, path: Path | str, arrays: Mapping[str, NDArray[Any]], header: Mapping[str, object]
    ) -> None:
        """Write arrays, header and their checksum.

        Raises
        ------
        FileError
            If the file cannot be written.
        MissingExtraError
            If `safetensors` is not installed.
        """
        self.check_writer()
        from safetensors.numpy import save

        whole = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        described = {"format": self.format, **header}
        text = json.dumps({_SUM: _checksum(whole, described), **described})
        write_output(path, save(whole, metadata={self.key: text}))

    def read(
        self,
        path: Path | str,
        names: Collection[str],
        build: Callable[[dict[str, NDArray[Any]], dict[str, Any]], _Content],
        *,
        newer: Collection[str] = (),
    ) -> _Content:
        """Read a file: what `build` makes of its arrays, which must have these names, and header.

        Arrays with `newer` names may be missing. It raises a `ModelError` if the file cannot be
        read, is of another kind or format, or is damaged, and a `MissingExtraError` if
        `safetensors` is not installed.
        """
        labels, arrays = _load(path, self.kind)
        text = labels.get(self.key)
        if text is None or set(arrays).difference(newer) != set(names):
            raise ModelError(f"{path}: {self.kind} of this package must be given; got another")
        try:
            header = json.loads(text)
            if header["format"] not in (self.format, *self.older):
                raise ModelError(f"{path}: format must be {self.format}; got {header['format']!r}")
            checksum = header.pop(_SUM, None)
            if checksum not in (None, _checksum(arrays, header)):
                raise ModelError(
                    f"{path} is damaged: its checksum does not fit; make it again or copy it anew"
                )
            _LOG.info("read %s from %s", self.kind, path)
            try:
                return build(arrays, header)
            except SmoskinError as error:
                raise ModelError(f"{path}: {error}") from error
        except ModelError:
            raise
        except _DAMAGE as error:
            raise ModelError(f"{path}: its description is damaged: {error!r}") from error


def freeze_model(
    record: object, kind: str, limits: Limits, **shapes: tuple[int | None, ...]
) -> None:
    """Turn a model's fields into read-only arrays of these shapes, while it is being made.

    It raises a `ModelError` if a field has another shape, or a number is beyond its limits, which
    are far wider than anything that can be.
    """
    try:
        freeze(record, **shapes)
    except ArgumentError as error:
        raise ModelError(f"{kind}: {error}") from error
    for name, (least, most) in limits.items():
        if (value := getattr(record, name)) is not None:
            check_within(f"{kind}: {name}", value, least, most)


def check_within(name: str, value: ArrayLike, least: ArrayLike, most: ArrayLike) -> None:
    """Raise a `ModelError` unless all numbers are finite and lie between these, which broadcast."""
    try:
        given, low, high = np.broadcast_arrays(floats(name, value), least, most)
    except ValueError as error:
        raise ModelError(f"{error}") from error
    if not np.isfinite(given).all():
        raise ModelError(f"{name} must be finite")
    wrong = (given < low) | (given > high)
    if wrong.any():
        got, low, high = (part[wrong].flat[0] for part in (given, low, high))
        positive = "be positive, " if low > 0 else "lie "
        raise ModelError(f"{name} must {positive}within {low:g} and {high:g}; got {got:g}")


def check_filled(kind: str, arrays: Mapping[str, NDArray[Any]], *names: str) -> None:
    """Refuse a file's arrays that hold nothing but zeros."""
    for name in names:
        if arrays[name].size and not arrays[name].any():
            raise ModelError(f"{kind}: {name} must not be zero everywhere")


def tensor_key(path: Path | str) -> str:
    """Key of a tensor file's header, which tells its kind; "" if there is none.

    Errors are those of `TensorFile.read`.
    """
    return next(iter(_load(path, "a tensor file")[0]), "")


def _load(path: Path | str, kind: str) -> tuple[dict[str, str], dict[str, NDArray[Any]]]:
    """The labels and the arrays of a tensor file."""
    require(f"reading {kind}", "learned", "safetensors")
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        whole = read_input(path, _LARGEST)
        arrays = load(whole)
        header = json.loads(whole[8 : 8 + int.from_bytes(whole[:8], "little")])
    except (SafetensorError, OSError, *_DAMAGE) as error:
        raise ModelError(f"{path}: cannot be read as {kind}: {error}") from error
    return header.get("__metadata__", {}), arrays


def _checksum(arrays: Mapping[str, NDArray[Any]], header: Mapping[str, object]) -> str:
    """SHA-256 of arrays and header."""
    whole = hashlib.sha256(json.dumps(header).encode())
    for name in sorted(arrays):
        array = arrays[name]
        whole.update(f"{name} {array.dtype.str} {array.shape}".encode())
        whole.update(array.tobytes())
    return whole.hexdigest()
