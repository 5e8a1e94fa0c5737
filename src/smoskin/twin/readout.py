"""From motion to what the chips read: fields of all magnets, and the chips as instruments.

Decides the frames: what a skin is made with, and how its magnets move, is along the local axes of
magnets and chips. The board carries chips and sheet; it slides, sinks and tilts over the base,
which carries the base's magnets and stands still in the skin's frame, as the Earth's field and
neighbouring skins do. Hides how a made skin's magnets and chips are off their designed poses.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arguments import typed
from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import arrangement_field, rotation_matrix
from smoskin.magnetics.dipole import dipole_field, sector_dipoles
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, check_temperature, magnet_factor
from smoskin.mechanics.board import board_of
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Motion, Reading
from smoskin.roles import VirtualSkin
from smoskin.twin.manufacture import Deviations, as_designed
from smoskin.twin.surroundings import Ambience, Surroundings


class Readout:
    """The magnetic half of a twin: by default as designed, with nothing around it.

    `rest`, (G, 6), is how far the magnets of the sheet rest from their designed poses, as
    `Motion.magnets`.
    """

    def __init__(
        self,
        design: SkinDesign,
        deviations: Deviations | None = None,
        surroundings: Surroundings | None = None,
        *,
        rest: Floats | None = None,
    ) -> None:
        made, around = deviations or as_designed(design), surroundings or Surroundings()
        self._design = design
        self._magnets = [
            replace(magnet, remanence=magnet.remanence * float(factor))
            for magnet, factor in zip(design.magnets, made.remanence, strict=True)
        ]
        self._on_base = np.array([magnet.mount == "base" for magnet in design.magnets])
        hung = np.zeros((len(design.magnets), 6)) if rest is None else rest
        skin = geometry(design)
        self._axes = skin.magnet_axes
        off = [_turned(self._axes, part) for part in (made.magnet_place, hung[:, :3])]
        self._places = skin.magnets + off[0] + off[1]
        self._turns = rotation_matrix(hung[:, 3:]) @ rotation_matrix(made.magnet_turn)
        self._made = made.chips
        self._chips = skin.chips + _turned(skin.chip_axes, made.chips.place)
        self._to_skin = skin.chip_axes @ made.chips.rotations(design.halls)
        self._middle = board_of(design).middle
        self._earth = around.earth
        self._uneven: tuple[Floats, Floats] | None = None
        if made.sectors is not None:
            pairs = [*map(sector_dipoles, self._magnets, made.sectors)]
            self._uneven = np.stack([a for a, _ in pairs]), np.stack([m for _, m in pairs])
        self._neighbours = [
            (other.place + skin.magnets @ rotation.T, rotation @ skin.magnet_axes)
            for other in around.neighbours
            for rotation in (rotation_matrix(other.turn),)
        ]

    def field(self, motion: Motion, temperature: ArrayLike = REFERENCE_TEMPERATURE) -> Floats:
        """As `VirtualSkin.field`."""
        return self._field(motion, _turn(motion), temperature)

    def seen(
        self,
        motion: Motion,
        temperature: ArrayLike = REFERENCE_TEMPERATURE,
        around: Ambience | None = None,
    ) -> Floats:
        """Readings of chips without noise, steps and limits, (..., S, 3), T, in their own axes.

        Where they sit and what their axes get wrong is included.
        """
        board = _turn(motion)
        to_skin = board[..., None, :, :] @ self._to_skin
        field = self._field(motion, board, temperature, around)
        turned = np.einsum("...sij,...si->...sj", to_skin, field)
        return self._made.answers(turned, self._chip_warmth(temperature, around))

    def risen(self, motion: Motion) -> Floats:
        """Change of `seen` from the untouched skin in (B,) states, (B, S, 3), T.

        It is along the local axes at the chips, as these were meant to stand.
        """
        rest = Motion.rest(len(self._design.magnets))
        turns = mlx90393.rotations(self._design.halls)
        return np.asarray(np.einsum("sij,bsj->bsi", turns, self.seen(motion) - self.seen(rest)))

    def sample(
        self,
        motion: Motion,
        rng: np.random.Generator,
        temperature: ArrayLike = REFERENCE_TEMPERATURE,
        around: Ambience | None = None,
    ) -> mlx90393.HallSample:
        """As `VirtualSkin.sample`, with what is round the chips in each of (T,) states."""
        reported = self._chip_warmth(temperature, around) + self._made.warmth
        seen = self.seen(motion, temperature, around)
        return mlx90393.measure(seen, self._design.hall_setting, temperature=reported, rng=rng)

    def read(
        self,
        motion: Motion,
        rng: np.random.Generator | None,
        *,
        time: float = 0.0,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """One reading of one state; without a generator the chips are ideal."""
        if rng is None:
            seen = self.seen(motion, temperature)
            lost = ~np.isfinite(seen).all(axis=-1)
            return Reading(
                time=time,
                field=seen,
                temperature=temperature + self._made.warmth,
                flags=np.where(lost, int(ChipFlag.INVALID), int(ChipFlag.GOOD)),
            )
        sample = self.sample(motion, rng, temperature)
        return Reading(
            time=time,
            field=mlx90393.tesla(sample.counts, self._design.hall_setting),
            temperature=mlx90393.degrees(sample.temperature_counts),
            flags=sample.flags,
        )

    def _field(
        self, motion: Motion, board: Floats, temperature: ArrayLike, around: Ambience | None = None
    ) -> Floats:
        """Field of all magnets and the surroundings, with the board's rotation at hand."""
        moved = motion.magnets
        shift = motion.board[..., None, :3]
        chips = self._over_base(self._chips, board, shift)
        # A magnet of the base is where it was built; one of the sheet goes with the board.
        places = np.where(
            self._on_base[:, None],
            self._places,
            self._over_base(self._places + _turned(self._axes, moved[..., :3]), board, shift),
        )
        turns = np.where(
            self._on_base[:, None, None],
            self._axes @ self._turns,
            board[..., None, :, :] @ self._axes @ rotation_matrix(moved[..., 3:]) @ self._turns,
        )
        total = arrangement_field(self._magnets, places, turns, chips)
        if self._uneven is not None:
            total = total + _uneven_field(*self._uneven, places, turns, chips)
        for places, turns in self._neighbours:
            total = total + arrangement_field(self._design.magnets, places, turns, chips)
        if around is None:
            factor = magnet_factor(check_temperature(temperature))
            return np.asarray(total * factor[..., None, None] + self._earth)
        warmth = np.asarray(temperature, dtype=np.float64)[..., None] + around.magnets
        factor = magnet_factor(check_temperature(warmth))
        return np.asarray(total * factor[..., None] + self._earth + around.field)

    def _chip_warmth(self, temperature: ArrayLike, around: Ambience | None) -> Floats:
        """Temperatures of the chips, broadcast against (..., S), degC."""
        skin = np.asarray(temperature, dtype=np.float64)[..., None]
        return skin if around is None else skin + around.chips

    def _over_base(self, places: Floats, board: Floats, shift: Floats) -> Floats:
        """Places on the board, (..., P, 3), as the base sees them."""
        turned = (places - self._middle) @ np.swapaxes(board, -1, -2)
        return np.asarray(turned + self._middle + shift)


class MagneticSkin(VirtualSkin):
    """A virtual skin of any mechanics, whose motions its readout turns to what the chips read."""

    deviations: Deviations
    """Deviations of the made skin from its design."""
    readout: Readout
    """Magnets and chips."""
    noise: np.random.Generator | None
    """Generator of the noise of live readings; None where the chips are ideal."""

    def forget(self) -> None:
        """Answer the next touch as if it were the first, to the last bit; nothing by default."""

    @typed
    def field(self, motion: Motion, temperature: ArrayLike = REFERENCE_TEMPERATURE) -> Floats:
        """As `VirtualSkin.field`."""
        return self.readout.field(motion, floats("temperature", temperature))

    @typed
    def sample(
        self,
        motion: Motion,
        rng: np.random.Generator,
        *,
        temperature: ArrayLike = REFERENCE_TEMPERATURE,
        around: Ambience | None = None,
    ) -> mlx90393.HallSample:
        """As `VirtualSkin.sample`, with what is round the chips in each of (T,) states."""
        return self.readout.sample(motion, rng, floats("temperature", temperature), around)

    @typed
    def sense(
        self, motion: Motion, *, time: float = 0.0, temperature: float = REFERENCE_TEMPERATURE
    ) -> Reading:
        """As `VirtualSkin.sense`."""
        return self.readout.read(motion, self.noise, time=time, temperature=temperature)


def _uneven_field(
    offsets: Floats, moments: Floats, places: Floats, turns: Floats, chips: Floats
) -> Floats:
    """Field at chips (..., S, 3), m, of dipoles (G, D, 3) that go with magnets, (..., S, 3), T."""
    middles = places[..., :, None, :] + np.einsum("...gij,gdj->...gdi", turns, offsets)
    turned = np.einsum("...gij,gdj->...gdi", turns, moments)
    away = chips[..., :, None, None, :] - middles[..., None, :, :, :]
    return np.asarray(dipole_field(turned[..., None, :, :, :], away).sum(axis=(-3, -2)))


def _turned(axes: Floats, components: Floats) -> Floats:
    """Vectors (..., N, 3) of components along local axes, (N, 3, 3)."""
    return np.asarray((axes @ components[..., None])[..., 0])


def _turn(motion: Motion) -> Floats:
    """Rotation matrices of the board, (..., 3, 3)."""
    return rotation_matrix(motion.board[..., 3:])
