"""The package's errors: each is a `SmoskinError` and also the builtin error that it is.

Wrong use raises one of these at once. A bad *measurement* never raises: it becomes an
`smoskin.Estimate` whose `smoskin.Status` says what is wrong.
"""


class SmoskinError(Exception):
    """Any error that this package raises on purpose."""


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


class EngineError(SmoskinError, RuntimeError):
    """Work that its workers could not finish, or not in time."""


class MissingExtraError(SmoskinError, ImportError):
    """An optional dependency that the asked-for function needs is not installed."""

    def __init__(self, purpose: str, extra: str) -> None:
        super().__init__(f"{purpose} needs the extra {extra!r}: pip install 'smoskin[{extra}]'")
