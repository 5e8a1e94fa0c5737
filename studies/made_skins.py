"""Made skins of the tolerance table: they assemble without contact, and chips stay in range.

Every skin is drawn from `smoskin.fabrication.process.tolerances`. Its parts are put together with
what laser, moulds and hands leave of their measures, and it is pressed with 1 N and 0.5 N of drag
in four directions on cells all over. ``python -m studies.made_skins --skins 200``
"""

import argparse
from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.pattern.flat import crease_folds, crease_gaps
from smoskin.fabrication.process.tolerances import CUT, made_tolerances
from smoskin.fabrication.workshop import LASER, Workshop
from smoskin.feasibility import RATED_PRESS, RATED_SHEAR, load_design
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.twin.manufacture import Deviations, drawn_skin
from smoskin.twin.whole import Twin

THICKNESS: Final = 0.1
"""Limit of a sheet's thickness, relative: cast acrylic is sold so."""
_CELLS: Final = 3
"""Cells pressed along x and y: corners, edges and the middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeSkin:
    """One made skin: least clearances, m, and the largest share of a chip's range."""

    panels: float
    """Spare gap between the nearest two panels, folded."""
    holder: float
    """Play that is left between a holder's notches and a column."""
    frame: float
    """Clearance that is left between a rim column and the frame."""
    chip: float
    """Room between a holder's floor and its chip's package."""
    range_share: float
    """Largest reading over the range, at rest and pressed."""
    converged: bool
    """Whether every press found an equilibrium."""

    @property
    def assembles(self) -> bool:
        """Whether nothing touches."""
        return min(self.panels, self.holder, self.frame, self.chip) > 0.0

    @property
    def good(self) -> bool:
        """Whether it assembles, and is read without saturation."""
        return self.assembles and self.range_share < 1.0 and self.converged


def made_skin(design: SkinDesign, workshop: Workshop, seed: int) -> MadeSkin:
    """The skin of a seed, put together and pressed."""
    deviations = drawn_skin(design, seed, made_tolerances(design))
    room = clearances(design, workshop, deviations, np.random.default_rng([seed, 1]))
    twin = Twin(design, seed=None, deviations=deviations)
    motion = twin.motions(touches_of(presses(design)))
    seen = np.abs(twin.readout.seen(motion))
    still = np.abs(twin.readout.seen(twin.motion()))
    full = mlx90393.full_scale(design.hall_setting)
    largest = np.nanmax(np.concatenate([seen.reshape(-1, 3), still.reshape(-1, 3)]) / full)
    converged = bool(motion.valid.all())
    return MadeSkin(**room, range_share=float(largest), converged=converged)


def presses(design: SkinDesign) -> list[list[Contact]]:
    """The rated press on cells all over, dragged to four sides."""
    tops = geometry(design).tops
    picks = [np.unique(np.linspace(0, n - 1, _CELLS).round().astype(int)) for n in design.cells]
    return [
        [Contact(position=tops[n, m], force=(*(RATED_SHEAR * np.array(way)), -RATED_PRESS))]
        for n in picks[0]
        for m in picks[1]
        for way in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]


def clearances(
    design: SkinDesign, workshop: Workshop, made: Deviations, rng: np.random.Generator
) -> dict[str, float]:
    """Least room between parts as they are made."""

    def miss(*shape: int, limit: float = LASER) -> Floats:
        return np.asarray(limit / CUT * np.clip(rng.normal(size=shape), -CUT, CUT))

    creases = 2 * len(made.creases)
    spare = []
    folds, along_a = crease_folds(design), geometry(design).sheet.along_a
    furthest = folds[along_a].max(), folds[~along_a].max()
    for gaps, fold in zip(crease_gaps(design, workshop), furthest, strict=True):
        panel = design.panels.thickness / 2 * (1 + miss(creases, limit=THICKNESS))
        glue = workshop.adhesive * (1 + miss(creases, limit=2 * THICKNESS))
        plate = design.creases.thickness / 2 + panel + glue
        closed = 2 * plate * np.tan(float(fold) / 2)
        spare.append((gaps.concave + miss(creases) - closed).min())
    columns, magnets = made.heights.size, len(design.magnets)
    # A column's place, its radius and the notch's or frame's own miss come together.
    sides = miss(columns) + miss(columns) + miss(columns)
    aside = np.abs(made.magnet_place[:, :2]).max()
    play = min(magnet.play for magnet in design.magnets)
    floors = [
        site.gap - (1e-3 - design.board.sensing_height) - 0.8e-3
        for site in design.halls
        if design.magnet(site.magnet).mount == "sheet"
    ]
    down = made.magnet_place[:, 2].min() - made.chips.place[:, 2].max()
    return {
        "panels": float(min(spare)),
        "holder": float(play + miss(4 * magnets).min() + sides.min() - aside),
        "frame": float(made.frame * design.frame.clearance + sides.min()),
        "chip": float(min(floors) + down),
    }


def main() -> None:
    """Draw, assemble and press skins, and tell how many are good."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--skins", type=int, default=200)
    parser.add_argument("--design", default="planar")
    given = parser.parse_args()
    design = load_design(given.design)
    skins = [made_skin(design, Workshop(), seed) for seed in range(given.skins)]
    good = sum(skin.good for skin in skins)
    apart = sum(skin.assembles for skin in skins)
    print(f"{good} of {given.skins} skins are good; {apart} assemble without contact")
    for name in ("panels", "holder", "frame", "chip"):
        least = sorted(1e3 * getattr(skin, name) for skin in skins)
        print(f"{name}: least {least[0]:.3f} mm, middle {least[len(least) // 2]:.3f} mm")
    shares = sorted(skin.range_share for skin in skins)
    at = int(0.95 * len(shares))
    print(
        f"range: 95 % stay below {shares[min(at, len(shares) - 1)]:.3f}, all below {shares[-1]:.3f}"
    )
    print(f"no equilibrium: {sum(not skin.converged for skin in skins)}")


if __name__ == "__main__":
    main()
