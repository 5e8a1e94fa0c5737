"""How one skin answers a press and a drag on each of its cells, as measured.

The field of a real sheet is not the separable one of S10 and S11, so no rule of signs and ratios
that theory gives holds on it. The table keeps what each chip saw when each cell was pressed by a
newton, and when it was dragged by one; it presumes that the answers of one cell add.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, frozen
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressTable:
    """Motion of each chip against its magnet for a newton on each cell; N x M cells, S chips.

    A newton and not a metre: a force is what is looked for, and the gauge that gave it errs no
    more than a stage. What presses holds the skin sideways as well; the lower chip feels that
    hold as it feels a drag. It is part of the answer to a straight press, so that a drag is only
    what comes on top.

    Raises
    ------
    ModelError
        If shapes disagree, a number is not finite, or a cell does not answer.
    """

    press: Floats
    """(N, M, S, 3), m/N, in the skin's axes: for a straight press."""
    drag: Floats
    """(N, M, S, 3, 2), m/N: for a drag in x and for one in y."""

    def __init__(self, *, press: ArrayLike, drag: ArrayLike) -> None:
        pressed = frozen("press", press, (None, None, None, 3))
        object.__setattr__(self, "press", pressed)
        object.__setattr__(self, "drag", frozen("drag", drag, (*pressed.shape, 2)))
        for n, m in np.ndindex(pressed.shape[:2]):
            answers = self.answers[n, m]
            if not np.isfinite(answers).all() or np.linalg.matrix_rank(answers) < 3:
                raise ModelError(
                    "press_table must be finite and answer a press, a drag in x and a drag in y "
                    f"each in its own way; cell ({n + 1}, {m + 1}) does not"
                )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PressTable):
            return NotImplemented
        return np.array_equal(self.press, other.press) and np.array_equal(self.drag, other.drag)

    __hash__ = None  # type: ignore[assignment]

    @property
    def answers(self) -> Floats:
        """(N, M, 3S, 3), m/N: all chips' motions for a press, a drag in x and a drag in y."""
        columns = np.concatenate([self.press[..., None], self.drag], axis=-1)
        return columns.reshape(*self.press.shape[:2], -1, 3)

    def check_fits(self, design: SkinDesign) -> None:
        """Raise unless the table has the design's cells and chips.

        Raises
        ------
        ModelError
        """
        shape = (*design.cells, len(design.halls))
        if self.press.shape[:3] != shape:
            raise ModelError(
                f"press_table must have the design's cells and chips, {shape}; "
                f"got {self.press.shape[:3]}"
            )


def uniform_drag(
    design: SkinDesign, board: float | None = None, sheet: float | None = None
) -> Floats:
    """Motion of the chips for a drag that moves the sheet as a whole.

    Parameters
    ----------
    design : SkinDesign
    board : float, optional
        N/m, K_sf: of the board on its base; as designed by default.
    sheet : float, optional
        N/m: of the sheet on the board; as designed by default.

    Returns
    -------
    Floats, shape (N, M, S, 3, 2)
        m/N; alike for all cells.

    Notes
    -----
    Source: SI Eq. (S26) and Text S5. Chips move with the board over a magnet of the base; a
    magnet of the sheet moves ahead of its chip.
    """
    mounts = [design.magnet(site.magnet).mount for site in design.halls]
    slides = {"base": 1 / (board or board_stiffness(design)),
              "sheet": -1 / (sheet or sheet_stiffness(design))}  # fmt: skip
    answer = np.zeros((*design.cells, len(mounts), 3, 2))
    for s, mount in enumerate(mounts):
        answer[:, :, s, [0, 1], [0, 1]] = slides[mount]
    return answer
