"""The package's errors: each is a `SmoskinError` and also the builtin error that it is.

Wrong use raises one of these at once. A bad *measurement* never raises: it becomes an
`smoskin.Estimate` whose `smoskin.Status` says what is wrong.
"""

from importlib.util import find_spec
from typing import Final

LONGEST: Final = 300
"""Characters of a message."""


def one_line(text: str, room: int = LONGEST) -> str:
    """A text as a line of so many characters at most.

    What would not print is escaped; of what is too long the middle is left out.
    """
    plain = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    if len(plain) <= room:
        return plain
    end = room // 3
    return f"{plain[: room - end - 5]} ... {plain[-end:]}"


class SmoskinError(Exception):
    """Any error that this package raises on purpose.

    Its message is one line of at most 300 characters; those that would not print are escaped.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


class DesignError(SmoskinError, ValueError):
    """A skin design that cannot be built, cannot fold or cannot be read."""


class ArgumentError(SmoskinError, ValueError):
    """An argument of the wrong shape, sign, range or kind."""


class SourceError(SmoskinError, OSError):
    """A source of readings that cannot be opened or does not answer in time."""


class RecordingError(SmoskinError, ValueError):
    """A recording or data set that cannot be read, or is not of the expected layout."""


class ModelError(SmoskinError, ValueError):
    """A trained model or calibration that cannot be read or does not fit the skin."""


class FileError(SmoskinError, OSError):
    """A file that cannot be read or written, or must not be."""


class CalibrationError(SmoskinError, ValueError):
    """Measurements that fit no skin of the design; the message names what seems to be wrong."""


class ContractError(SmoskinError, ValueError):
    """An object handed in that does not keep what its role promises; the message names it."""


class EngineError(SmoskinError, RuntimeError):
    """Work that its workers could not finish, or not in time."""


class MissingExtraError(SmoskinError, ImportError):
    """An optional dependency that the asked-for function needs is not installed."""

    def __init__(self, purpose: str, extra: str) -> None:
        super().__init__(f"{purpose} needs the extra {extra!r}: pip install {_origin(extra)}")


def require(purpose: str, extra: str, *modules: str) -> None:
    """Raise `MissingExtraError` unless these libraries of an extra are installed."""
    try:
        missing = any(find_spec(module) is None for module in modules)
    except ImportError:  # as an import hook says it, or a package around the module that is missing
        missing = True
    if missing:
        raise MissingExtraError(purpose, extra)


def _origin(extra: str) -> str:
    """What pip takes to add an extra: the folder or file that this package was installed from."""
    import json  # here and below, so that the package starts fast
    from importlib.metadata import PackageNotFoundError, distribution
    from urllib.parse import unquote, urlsplit

    try:
        origin = json.loads(distribution("smoskin").read_text("direct_url.json") or "{}")
    except PackageNotFoundError:
        return f"'.[{extra}]'"
    where = unquote(urlsplit(origin.get("url", "")).path)
    if not where or not origin["url"].startswith("file:"):
        return f"'smoskin[{extra}]'"
    editable = "-e " if origin.get("dir_info", {}).get("editable") else ""
    return f"{editable}'{where}[{extra}]'"
