"""The role of an arm: it is asked for speeds of its joints, and tells what it really does."""

from abc import abstractmethod
from dataclasses import dataclass

from smoskin.arrays import Floats, freeze
from smoskin.robot.chain import Chain
from smoskin.roles import Resource


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArmState:
    """One moment of an arm, as its own encoders have it."""

    angles: Floats
    """(J,), rad."""
    speeds: Floats
    """(J,), rad/s."""
    meets: str = ""
    """What of the arm meets what, itself or its surroundings; empty where nothing does."""

    def __post_init__(self) -> None:
        freeze(self, angles=(None,), speeds=(len(self.angles),))


class Arm(Resource):
    """An arm that is moved by speeds of its joints; closing it stops it.

    Every implementation goes on at the speeds asked for last for at most 0.1 s: whoever moves it
    asks again and again, and an arm whose master is gone stands.
    """

    @property
    @abstractmethod
    def chain(self) -> Chain:
        """Its joints and the place of the skin."""

    @abstractmethod
    def state(self) -> ArmState:
        """What it does now; raises a `SourceError` if it does not answer."""

    @abstractmethod
    def move(self, speeds: Floats) -> Floats:
        """Turn the joints at these speeds, (J,), rad/s; those that it really was told.

        It raises a `SourceError` if the arm does not take them.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stand, as fast as the joints' accelerations allow; any number of times."""
