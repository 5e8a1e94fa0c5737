"""Files of what was learned: arrays, and what they mean as JSON in the file's header.

Decides how such a file is written and which is refused; what stands in it is its owner's. The
format is safetensors, which carries no code.
"""

import json
import logging
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from smoskin.arrays import freeze
from smoskin.errors import ArgumentError, MissingExtraError, ModelError

_LOG: Final = logging.getLogger(__name__)
RESPONSE_TABLE: Final = "smoskin_response_table"
NETWORK: Final = "smoskin_network"
"""Keys of the kinds that programs tell apart by `tensor_key`."""

_Content = TypeVar("_Content")


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

    def write(
        self, path: Path | str, arrays: Mapping[str, NDArray[Any]], header: Mapping[str, object]
    ) -> None:
        """Write arrays and header; `MissingExtraError` if `safetensors` is not installed."""
        try:
            from safetensors.numpy import save_file
        except ImportError as error:
            raise MissingExtraError(f"writing {self.kind}", "learned") from error
        text = json.dumps({"format": self.format, **header})
        whole = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        save_file(whole, str(path), metadata={self.key: text})

    def read(
        self,
        path: Path | str,
        names: Collection[str],
        build: Callable[[dict[str, NDArray[Any]], dict[str, Any]], _Content],
    ) -> _Content:
        """Read a file: what `build` makes of its arrays, which must have these names, and header.

        It raises a `ModelError` if the file cannot be read, is of another kind or format, or is
        damaged, and a `MissingExtraError` if `safetensors` is not installed.
        """
        with _opened(path, self.kind) as file:
            text = (file.metadata() or {}).get(self.key)
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if text is None or set(arrays) != set(names):
            raise ModelError(f"{path}: {self.kind} of this package must be given; got another")
        try:
            header = json.loads(text)
            if header["format"] not in (self.format, *self.older):
                raise ModelError(f"{path}: format must be {self.format}; got {header['format']!r}")
            _LOG.info("read %s from %s", self.kind, path)
            return build(arrays, header)
        except ModelError:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"{path}: its description is damaged: {error!r}") from error


def freeze_model(record: object, kind: str, **shapes: tuple[int | None, ...]) -> None:
    """Turn a model's fields into read-only finite arrays of these shapes, while it is being made.

    It raises a `ModelError` if a field has another shape or is not finite.
    """
    try:
        freeze(record, **shapes)
    except ArgumentError as error:
        raise ModelError(f"{kind}: {error}") from error
    for name in shapes:
        if not np.isfinite(getattr(record, name)).all():
            raise ModelError(f"{kind}: {name} must be finite")


def tensor_key(path: Path | str) -> str:
    """Key of a tensor file's header, which tells its kind; "" if there is none.

    Errors are those of `TensorFile.read`.
    """
    with _opened(path, "a tensor file") as file:
        return next(iter(file.metadata() or {}), "")


@contextmanager
def _opened(path: Path | str, kind: str) -> Iterator[Any]:
    """A tensor file, open for reading."""
    try:
        from safetensors import SafetensorError, safe_open
    except ImportError as error:
        raise MissingExtraError(f"reading {kind}", "learned") from error
    try:
        with safe_open(str(path), framework="numpy") as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{path}: cannot be read as {kind}: {error}") from error
