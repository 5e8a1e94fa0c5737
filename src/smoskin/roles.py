"""Who passes the records on: sources give readings, estimators make estimates, sinks take both.

A rig touches a skin where it is told and gives what is known of the touch; a contact law says which
vertices of a simulated sheet take it. Every concrete source and estimator of the package is one of
these, and the contract suites in `tests/contracts` hold each of them to the sentences written here.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.mlx90393 import HallSample
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.contact import ContactLaw as ContactLaw
from smoskin.mechanics.sheet.touches import Touches
from smoskin.records import Contact, Estimate, HeldTouch, Motion, Pose, Reading

Progress: TypeAlias = Callable[[str, float], None]
"""A listener to long work: told what is being done, and the share of the whole that is done."""


def unheard(what: str, share: float) -> None:
    """Listen to no progress; the default of all that takes long."""


def stopwatch() -> Callable[[], float]:
    """A clock that tells the seconds since now."""
    begun = time.monotonic()
    return lambda: time.monotonic() - begun


class Resource(ABC):
    """Something held open; a context manager that closes it at the end."""

    @abstractmethod
    def close(self) -> None:
        """Release whatever is held; any number of times."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Source(Resource):
    """Readings, one after the other.

    Iterating yields readings until the source ends. `close` may be called from any thread;
    afterwards `read` returns None.
    """

    @property
    @abstractmethod
    def chips(self) -> int:
        """Number of chips in every reading."""

    @property
    def design_hash(self) -> str | None:
        """Content hash of the design of the skin that is read; None where the source has none."""
        return None

    @property
    def design(self) -> SkinDesign | None:
        """Design of the skin that is read; None where the source does not know it."""
        return None

    @abstractmethod
    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading; None when the source has ended or is closed.

        Raises
        ------
        SourceError
            If no reading comes within `timeout` seconds.
        """

    def __iter__(self) -> Iterator[Reading]:
        while (reading := self.read()) is not None:
            yield reading


class Estimator(ABC):
    """Turns each reading into an estimate; keeps what it must remember between readings."""

    @abstractmethod
    def step(self, reading: Reading) -> Estimate:
        """The estimate of one reading.

        A bad measurement becomes an estimate with a `Status`, never an exception. No touch is
        answered with `Status.CONTACT` before there is a zero, off the skin, above the force that
        is known, or where a chip cannot be right: its temperature or its field beyond its range or
        jumping, or frozen while the others move. A clock that goes back by more than 2 s has
        started again: after one `Status.STALE` it is followed, with the zero and no past.

        Raises
        ------
        ArgumentError
            If the reading has another number of chips than the estimator was made for.
        """

    def carried_by(self, pose: Callable[[], Pose]) -> None:
        """Know from here on how an arm holds the skin, and begin anew.

        The function gives the arm's pose at the newest reading. What poses change is learned while
        nothing touches, and taken off. By default an estimator cannot: `ArgumentError`.
        """
        raise ArgumentError(
            f"estimator must be of a skin's design to take poses into account; got {type(self)}"
        )

    @property
    @abstractmethod
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""

    @abstractmethod
    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take the mean of these readings of the untouched skin as its zero.

        Raises
        ------
        ArgumentError
            If there are none in which every chip that is used was good, or one has another number
            of chips than the estimator was made for; and, unless `force` says that nothing
            touches, if they move among themselves by more than noise or read as a touch.
        """

    @abstractmethod
    def unzero(self) -> None:
        """Return to the zero before the last; `ArgumentError` if there is none to return to."""

    @abstractmethod
    def reset(self) -> None:
        """Return to the zero of the start and forget everything remembered between readings."""


class Sink(Resource):
    """Takes readings with their estimates, from one thread at a time."""

    @abstractmethod
    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Take a reading and what was made of it, if anything."""

    @property
    def dropped(self) -> int:
        """How many readings the sink has passed over."""
        return 0


class Rig(Resource):
    """Touches a skin where it is told, one touch after the other."""

    @property
    @abstractmethod
    def place_spread(self) -> float:
        """Standard deviation of the places that it reports, along each axis, m."""

    @property
    @abstractmethod
    def force_spread(self) -> float:
        """Standard deviation of the forces that it reports, along each axis, N."""

    @abstractmethod
    def press(self, contact: Contact, timeout: float = 30.0) -> HeldTouch:
        """Touch the skin so, hold still, let go.

        Raises
        ------
        ArgumentError
            If the skin cannot be touched so.
        SourceError
            If the touch is not over within `timeout` seconds.
        """


class VirtualSkin(ABC):
    """A simulated skin: touches become motions of its magnets, motions become readings.

    Temperatures are those of rubber, magnets and chips, in degC; every method answers at the
    temperature that it is given, whatever was asked before.
    """

    design: SkinDesign
    """The skin as designed."""

    @abstractmethod
    def check(self, contacts: Sequence[Contact]) -> None:
        """Raise unless the skin can be touched so; may be called from any thread.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin, pulls at it, or is not finite.
        """

    def prepare(self) -> None:  # noqa: B027
        """Do what a first touch would have to wait for, such as compiling; nothing by default."""

    @abstractmethod
    def motion(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Motion:
        """Motion of magnets and board at rest under these contacts: one state, no batch axis.

        It raises as `check`, and `ArgumentError` if no skin stands the temperature.
        """

    @abstractmethod
    def motions(self, touches: Touches, *, temperature: float = REFERENCE_TEMPERATURE) -> Motion:
        """Motion of magnets and board in each of B states of touch, (B,); raises as `motion`."""

    @abstractmethod
    def field(self, motion: Motion, temperature: ArrayLike = REFERENCE_TEMPERATURE) -> Floats:
        """Field of all magnets and the surroundings at all chips, shape (..., S, 3), T.

        It is in the skin's frame, NaN in invalid ones of a batch (...) of states; the temperature
        is the magnets', degC, shape (...).
        """

    @abstractmethod
    def sample(
        self,
        motion: Motion,
        rng: np.random.Generator,
        *,
        temperature: ArrayLike = REFERENCE_TEMPERATURE,
    ) -> HallSample:
        """One conversion of every chip in each state (...), with this generator's noise.

        Counts are (..., S, 3); flags are `ChipFlag.INVALID` in invalid states.
        """

    @abstractmethod
    def sense(
        self, motion: Motion, *, time: float = 0.0, temperature: float = REFERENCE_TEMPERATURE
    ) -> Reading:
        """What the chips read in one state at a time, s; `ChipFlag.INVALID` in an invalid one."""

    @typed
    def read(
        self,
        contacts: Sequence[Contact] = (),
        *,
        time: float = 0.0,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """What the chips read under these contacts, once at rest; raises as `motion`."""
        motion = self.motion(contacts, temperature=temperature)
        return self.sense(motion, time=time, temperature=temperature)

    @abstractmethod
    def sheet_vertices(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """Vertices of the deformed sheet over the board, shape (V, 3), m."""

    @abstractmethod
    def depths(
        self, contacts: Sequence[Contact], *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """How far the skin under each contact has sunk, shape (K,), m; positive is down."""
