"""From a chunk of a sweep to its rows: presses, motions, fields and what the chips read.

Decides which twin answers, and what a row holds. Rows depend on the design, the sweep and the
chunk's number alone: nothing is carried from one chunk to the next but what is costly to build.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.datasets.patterns import Sweep
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import patch_shares
from smoskin.roles import VirtualSkin
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

AS_DESIGNED = -1
"""Stands for a manufactured skin's seed where there is none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """R presses of up to K touches, with what became of G magnets and S chips."""

    skin: Ints
    """(R,): seed of the manufactured skin; `AS_DESIGNED` for the design itself."""
    position: Floats
    """(R, K, 2), m."""
    force: Floats
    """(R, K, 3), N, on the skin; all zero where there is no touch."""
    radius: Floats
    """(R, K), m, of each touch."""
    temperature: Floats
    """(R,), degC."""
    magnet_shift: Floats
    """(R, G, 3), m, of each magnet over the board; NaN in invalid rows."""
    magnet_turn: Floats
    """(R, G, 3), rad: rotation vector of each magnet; NaN in invalid rows."""
    board_shift: Floats
    """(R, 2), m, of the board over the base; NaN in invalid rows."""
    board_turn: Floats
    """(R,), rad, of the board about z; NaN in invalid rows."""
    field: Floats
    """(R, S, 3), T: exact, at each chip, in the skin's frame; NaN in invalid rows."""
    reading: Floats
    """(R, S, 3), T: as each chip reads it, in its own axes, noise and limits included."""
    flags: Ints
    """(R, S), `ChipFlag` of each chip; INVALID in invalid rows."""
    valid: Bools
    """(R,): whether the skin has found its equilibrium."""

    def __len__(self) -> int:
        return len(self.skin)


def check_sweep(design: SkinDesign, sweep: Sweep) -> None:
    """Raise unless the skin can be pressed so; costs one chunk's presses.

    Raises
    ------
    ArgumentError
        If presses of the first chunk lie off the skin or pull at it.
    """
    patch_shares(design, sweep.touches(design, 0))


@final
class Simulation:
    """Computes any chunk of a sweep over a skin; travels to worker processes.

    Parameters
    ----------
    design : SkinDesign
    sweep : Sweep

    Raises
    ------
    ArgumentError
        If the skin cannot be pressed so.
    """

    def __init__(self, design: SkinDesign, sweep: Sweep) -> None:
        check_sweep(design, sweep)
        self._design, self._sweep = design, sweep
        self._twin: tuple[int | None, VirtualSkin] | None = None

    def __call__(self, chunk: int) -> Rows:
        """The rows of a chunk."""
        sweep, setting = self._sweep, self._design.hall_setting
        touches, degrees = sweep.touches(self._design, chunk), sweep.temperature(chunk)
        seed = sweep.skin(chunk)
        twin = self._skin(seed)
        motion = twin.motions(touches, temperature=degrees)
        field = twin.field(motion, degrees)
        sample = twin.sample(motion, sweep.noise(chunk), temperature=degrees)
        lost = ~motion.valid[:, None, None]
        reading = np.where(lost, np.nan, mlx90393.tesla(sample.counts, setting))
        count = len(touches.force)
        return Rows(
            skin=np.full(count, AS_DESIGNED if seed is None else seed),
            position=touches.position,
            force=touches.force,
            radius=touches.radius,
            temperature=np.full(count, degrees),
            magnet_shift=motion.magnets[..., :3],
            magnet_turn=motion.magnets[..., 3:],
            board_shift=motion.board[:, :2],
            board_turn=motion.board[:, 2],
            field=field,
            reading=reading,
            flags=sample.flags,
            valid=motion.valid,
        )

    def __reduce__(self) -> tuple[type["Simulation"], tuple[SkinDesign, Sweep]]:
        return Simulation, (self._design, self._sweep)

    def _skin(self, seed: int | None) -> VirtualSkin:
        """The skin of this seed, kept until another is asked for."""
        if self._twin is None or self._twin[0] != seed:
            twin: VirtualSkin
            if self._sweep.mechanics == "reduced":
                twin = ReducedTwin(self._design)
            else:
                made = seed is not None
                twin = Twin(self._design, seed=seed, manufactured=made, grip=self._sweep.grip)
            self._twin = (seed, twin)
        return self._twin[1]
