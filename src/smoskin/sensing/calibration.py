"""What distinguishes one skin from its design: the coefficients an estimator works with."""

from dataclasses import dataclass
from typing import Self

from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import ModelError
from smoskin.mechanics.stiffness import board_stiffness, sheet_stiffness


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The numbers of one skin."""

    design_hash: str
    """`SkinDesign.content_hash` of the design that it belongs to."""
    coefficients: Coefficients
    """v_a, v_s and v_f."""
    board_stiffness: float
    """N/m, K_sf: drag over motion of the board."""
    sheet_stiffness: float
    """N/m: drag over motion of the sheet against the board."""

    @classmethod
    def nominal(cls, design: SkinDesign) -> Self:
        """The calibration of a skin that is exactly as designed."""
        return cls(
            design_hash=design.content_hash,
            coefficients=design.coefficients,
            board_stiffness=board_stiffness(design),
            sheet_stiffness=sheet_stiffness(design),
        )

    def check_fits(self, design: SkinDesign) -> None:
        """Raise unless this calibration belongs to the design.

        Raises
        ------
        ModelError
            If the hashes differ.
        """
        if self.design_hash != design.content_hash:
            raise ModelError(
                f"calibration must belong to design {design.name!r} "
                f"({design.content_hash[:12]}); it was made for {self.design_hash[:12]}"
            )
