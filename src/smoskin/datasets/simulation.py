"""From a chunk of a sweep to its rows: presses, motions, fields and what the chips read.

Decides which twin answers, and what a row holds. Rows depend on the design, the sweep and the
chunk's number alone: nothing is carried from one chunk to the next but what is costly to build.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, Final, NamedTuple, final, get_type_hints

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.datasets.patterns import Sweep
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import check_on_skin
from smoskin.records import Motion
from smoskin.roles import VirtualSkin
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

AS_DESIGNED = -1
"""Stands for a manufactured skin's seed where there is none."""


class Column(NamedTuple):
    """A field of `Rows` in files."""

    name: str
    """Name, which ends on the unit."""
    about: str
    """Axes after the first, and meaning."""
    kind: str = "float64"
    """NumPy's name of the numbers' type."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """R presses of up to K touches, with what became of G magnets and S chips.

    Each field is an array with a row a press, in SI units. Rows that are not valid hold NaN.
    """

    skin: Annotated[
        Ints, Column("skin_seed", "seed of the manufactured skin; -1: as designed", "int64")
    ]
    position: Annotated[Floats, Column("position_m", "(touch, x y) on the undeformed skin")]
    force: Annotated[Floats, Column("force_N", "(touch, x y z) on the skin; all zero: no touch")]
    radius: Annotated[Floats, Column("radius_m", "(touch) of its patch")]
    temperature: Annotated[Floats, Column("temperature_degC", "of rubber, magnets and chips")]
    magnet_shift: Annotated[Floats, Column("magnet_shift_m", "(magnet, x y z) over the board")]
    magnet_turn: Annotated[Floats, Column("magnet_turn_rad", "(magnet, x y z) rotation vector")]
    board_shift: Annotated[Floats, Column("board_shift_m", "(x y z) over the base")]
    board_turn: Annotated[Floats, Column("board_turn_rad", "(x y z) of its rotation vector")]
    field: Annotated[Floats, Column("field_T", "(chip, x y z) exact, in the skin's frame")]
    reading: Annotated[Floats, Column("reading_T", "(chip, x y z) as read, in the chip's axes")]
    flags: Annotated[Ints, Column("flags", "(chip) 2 saturated, 16 invalid; 0: good", "int64")]
    valid: Annotated[
        Bools, Column("valid", "whether the skin is in equilibrium; otherwise NaN", "bool")
    ]

    def __len__(self) -> int:
        return len(self.skin)

    @property
    def motion(self) -> Motion:
        """The magnets and the board, (R,) states."""
        return Motion(
            magnets=np.concatenate([self.magnet_shift, self.magnet_turn], axis=-1),
            board=np.concatenate([self.board_shift, self.board_turn], axis=-1),
        )


COLUMNS: Final[Mapping[str, Column]] = MappingProxyType(
    {name: hint.__metadata__[0] for name, hint in get_type_hints(Rows, include_extras=True).items()}
)
"""Columns by the names of their fields."""


@final
class Simulation:
    """Computes any chunk of a sweep over a skin; travels to worker processes.

    It raises an `ArgumentError` if presses of the first chunk lie off the skin or pull at it.
    """

    def __init__(self, design: SkinDesign, sweep: Sweep) -> None:
        check_on_skin(design, sweep.touches(design, 0))
        self._design, self._sweep = design, sweep
        # Chunks of one skin follow each other: the last one made is kept.
        self._skin = lru_cache(maxsize=1)(self._make_skin)

    def __call__(self, chunk: int) -> Rows:
        """The rows of a chunk."""
        sweep, setting = self._sweep, self._design.hall_setting
        touches, degrees = sweep.touches(self._design, chunk), sweep.temperature(chunk)
        seed = sweep.skin(chunk)
        twin = self._skin(seed)
        motion = twin.motions(touches, temperature=degrees)
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
            board_shift=motion.board[:, :3],
            board_turn=motion.board[:, 3:],
            field=twin.field(motion, degrees),
            reading=reading,
            flags=sample.flags,
            valid=motion.valid,
        )

    def __reduce__(self) -> tuple[type["Simulation"], tuple[SkinDesign, Sweep]]:
        return Simulation, (self._design, self._sweep)

    def _make_skin(self, seed: int | None) -> VirtualSkin:
        """The skin of this seed."""
        if self._sweep.mechanics == "reduced":
            return ReducedTwin(self._design)
        return Twin(
            self._design,
            seed=seed,
            manufactured=seed is not None,
            tolerances=self._sweep.tolerances,
            grip=self._sweep.grip,
        )
