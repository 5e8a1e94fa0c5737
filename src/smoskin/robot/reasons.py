"""Why an arm stands: reasons that end by themselves, and faults that only a person resets."""

from enum import Enum
from typing import Final

from smoskin.records import Status


class Reason(Enum):
    """Why the arm stands, or that it moves; the value is a sentence for people."""

    DISARMED = "Nobody has armed the arm."
    SWITCH = "The switch that must be held is released."
    UNTOUCHED = "Nothing touches the skin."
    LIGHT = "The touch is lighter than what moves the arm."
    MOVING = "The arm moves along the force."
    RELEASING = "The arm gives way a little, so that nobody stays clamped."
    NO_WAY = "From here the joints cannot move the touched place along the force."
    JOINT_RANGE = "A joint is at the end of its range."
    WORKSPACE = "The touched place or a part of the arm is at the end of the workspace."
    DISTANCE = "The touch has moved the arm as far as one touch may; let go."
    DURATION = "The touch has moved the arm as long as one touch may; let go."
    TWO_TOUCHES = "Two places are touched at once."
    AMBIGUOUS = "The skin cannot tell where it is touched."
    WIDE = "The place of the touch is not known well enough."
    STALE = "The readings are old or come again."
    SILENT = "No estimate has come in time."
    CLOCK = "A clock has jumped."
    CHIP_MISSING = "A chip does not answer, or not truly."
    SATURATED = "A chip stands at the end of its range."
    NOT_CALIBRATED = "The skin has no zero that is believed."
    OUT_OF_RANGE = "The skin is touched otherwise or harder than is known."
    FORCE = "The touch is too hard."
    COLLISION = "The arm touches itself or what stands round it."
    DEADLINE = "The loop was late."
    ARM = "The arm does not answer, or not truly."
    ASTRAY = "The arm moves otherwise than it was asked to."

    @property
    def fault(self) -> bool:
        """Whether it stays until a person resets it."""
        return self in _FAULTS


_FAULTS: Final = frozenset(list(Reason)[list(Reason).index(Reason.STALE) :])
OF_STATUS: Final = {
    Status.SATURATED: Reason.SATURATED,
    Status.OUT_OF_RANGE: Reason.OUT_OF_RANGE,
    Status.AMBIGUOUS: Reason.AMBIGUOUS,
    Status.STALE: Reason.STALE,
    Status.CHIP_MISSING: Reason.CHIP_MISSING,
    Status.NOT_CALIBRATED: Reason.NOT_CALIBRATED,
}
"""What an estimate of each status means to the arm; the others are believed."""
