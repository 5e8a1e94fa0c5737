"""Estimators from files, and the zero that an estimator takes before it answers.

Decides which estimator reads which file, and hides how kinds of files are told apart.
"""

import os
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.document import shipped_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, DesignError, ModelError
from smoskin.outputs import read_text
from smoskin.records import Estimate, Pose, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing import files
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.calibration import parse_calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, load_model
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import load_network
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.estimator import FOLLOWING, ON_AN_ARM
from smoskin.sensing.signals.zero import ZeroTracking

_FAULTS: Final = (Status.CHIP_MISSING, Status.SATURATED, Status.STALE)
"""Answers to readings that tell of the chips, not of the skin."""


@typed
def load_estimator(
    path: str | os.PathLike[str],
    design: SkinDesign | None = None,
    *,
    uncalibrated: bool = False,
    arm: bool = False,
) -> Estimator:
    """The estimator that reads a file of this package, not zeroed yet unless its bench was.

    Parameters
    ----------
    path : path
        A calibration (TOML), a skin's response table, a network or a learned model.
    design : SkinDesign, optional
        Design of the skin; by default the shipped one that the file was made for.
    uncalibrated : bool
        Whether the table of a design will do, which no touches have made that of a skin.
    arm : bool
        Whether an arm turns the skin, so that its own weight moves it (`ZeroTracking.arm`).

    Raises
    ------
    ModelError
        If the file cannot be read, is of no such kind, was made for another design, or is a table
        that is not `ResponseTable.calibrated` and must be.
    ArgumentError
        If an arm is said to turn the skin of a learned model, which does not know its weight.
    MissingExtraError
        If it holds arrays and `safetensors` is not installed.

    Examples
    --------
    ::

        estimator = load_estimator("skin.table")
        estimator.zero(readings_of_the_untouched_skin)
        estimate = estimator.step(reading)
    """
    file, tracking = Path(path), ON_AN_ARM if arm else FOLLOWING
    if not _holds_arrays(file):
        text = read_text(file, error=ModelError)
        try:
            calibration = parse_calibration(text)
        except ModelError as error:
            raise ModelError(f"{file}: {error}") from error
        skin = _design_of(file, calibration.design_hash, design)
        return ClosedFormEstimator(skin, calibration, tracking=ZeroTracking(arm=arm))
    match files.tensor_key(file):
        case files.RESPONSE_TABLE:
            table = load_response_table(file)
            if not (table.calibrated or uncalibrated):
                raise ModelError(
                    f"{file}: must be the table of one skin; got that of a design, from which made "
                    "skins differ too much: calibrate it by touches of the skin first"
                )
            skin = _design_of(file, table.design_hash, design)
            return BayesEstimator(skin, table, tracking=tracking)
        case files.NETWORK:
            network = load_network(file)
            skin = _design_of(file, network.design_hash, design)
            return NetworkEstimator(skin, network, tracking=tracking)
        case _:
            if arm:
                raise ArgumentError("arm must be False for a learned model: it knows no weight")
            return LearnedEstimator(load_model(file))


class ZeroFirst(Estimator):
    """An estimator whose zero is taken as soon as the skin rests, and that is then that one.

    Until then readings are answered by `Status.NOT_CALIBRATED`. The zero is the mean of the first
    `count` good readings in a row that move by no more than noise; a touch that is held as still
    from the start on cannot be told from a skin at rest. `ArgumentError` if the count is not
    positive.
    """

    @typed
    def __init__(self, estimator: Estimator, *, count: int = 20) -> None:
        if count < 1:
            raise ArgumentError(f"count must be at least 1; got {count}")
        self.estimator = estimator
        self._untouched: deque[Reading] = deque(maxlen=count)
        self.zeroed = False
        """Whether the zero is taken."""

    def carried_by(self, pose: Callable[[], Pose]) -> None:
        """As `Estimator.carried_by`; the next good readings are the new zero."""
        self.estimator.carried_by(pose)
        self.reset()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self.estimator.drift

    def reset(self) -> None:
        """Forget everything; the next good readings are the new zero."""
        self.estimator.reset()
        self._untouched.clear()
        self.zeroed = False

    @typed
    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take these readings of the untouched skin as the zero, and wait for no others."""
        self.estimator.zero(readings, force=force)
        self._untouched.clear()
        self.zeroed = True

    def unzero(self) -> None:
        """Return to the zero before the last; `ArgumentError` if there is none."""
        self.estimator.unzero()

    def step(self, reading: Reading) -> Estimate:
        """The other estimator's answer, once it is zeroed."""
        estimate = self.estimator.step(reading)
        if self.zeroed or estimate.status in _FAULTS:
            return estimate
        self._untouched.append(reading)
        if len(self._untouched) == self._untouched.maxlen:
            with suppress(ArgumentError):  # it is moved: what comes next may rest
                self.zero(tuple(self._untouched))
        return Estimate(time=reading.time, status=Status.NOT_CALIBRATED)


def _holds_arrays(path: Path) -> bool:
    """Whether a file begins as tensor files do, with a length in binary: text holds no zeros."""
    with suppress(OSError):  # whoever reads it says why it cannot be read
        if path.is_file():
            with path.open("rb") as file:
                return b"\0" in file.read(8)
    return False


def _design_of(path: Path, content_hash: str, design: SkinDesign | None) -> SkinDesign:
    """The design that a file was made for: the given one, or a shipped one."""
    try:
        skin = shipped_design(content_hash) if design is None else design
    except DesignError as error:
        raise ModelError(f"{path}: {error}") from error
    skin.check_own(str(path), content_hash)
    return skin
