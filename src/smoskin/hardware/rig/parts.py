"""What a rig is built of: a stage that carries the probe, and a gauge that feels its force.

Decides that each call is over within its time or raises, so that no one waits for a dead part.
"""

from abc import abstractmethod

from smoskin.arrays import Floats
from smoskin.roles import Resource


class Stage(Resource):
    """Carries the probe; its z axis points away from the skin."""

    @abstractmethod
    def where(self) -> Floats:
        """Place of the probe in the stage's own frame, shape (3,), m.

        Raises
        ------
        SourceError
            If the stage does not answer, or is in alarm.
        """

    @abstractmethod
    def move(self, target: Floats, speed: float, timeout: float) -> None:
        """Go straight to a place, (3,), m, at a speed, m/s, and stand there.

        The stage is told one move at a time: whoever dies meanwhile leaves it at the target.

        Raises
        ------
        SourceError
            If it does not stand there within `timeout` seconds, was stopped, or is in alarm.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stand still at once, forgetting the move; from any thread.

        Raises
        ------
        SourceError
            If the stage cannot be told.
        """


class Gauge(Resource):
    """Feels how hard the probe presses."""

    @abstractmethod
    def force(self) -> float:
        """How hard the probe presses now, N; positive when it presses.

        Raises
        ------
        SourceError
            If the gauge does not answer, or answers what is no force.
        """

    @abstractmethod
    def tare(self) -> None:
        """Take what it feels now for no force.

        Raises
        ------
        SourceError
            If the gauge does not answer, or what it feels does not stand still.
        """
