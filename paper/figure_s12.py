"""
Figure S12: 200 touches of the curved skin
==========================================

The paper's curved skin was touched 200 times; means of its errors along the axis (X), round the
limb (T) and of the force are printed. The same on a made skin of the design `curved` that no table
has seen, after 60 labelled touches, in the hard world and in the plain one.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    Look,
    Plate,
    canvas,
    lay_out,
    open_axes,
    styled,
)
from smoskin.arrays import Floats
from smoskin.commands.score import Exam, candidate
from smoskin.commands.score.errors import Answers, together
from smoskin.commands.score.evaluate import judge, press
from smoskin.design.document import read_design
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.twin.world.effect import World
from smoskin.twin.world.worlds import world_of

PRINTED: Final = {"X": 2.05e-3, "T": 3.68e-3, "force": 0.063}
"""Mean errors, m and N."""
SEED: Final = 101
"""Seed of the made skin, the first of those that docs/derivations_curved.md judges by."""
COUNT: Final = 200
FORCES: Final = (0.3, 1.0)
"""N: range of the touches' normal forces; the paper prints none."""
_SESSIONS: Final = 4
"""Sessions of touches, each at a temperature of its own."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Touched:
    """Errors of touches in one world."""

    world: str
    along: Floats
    """(B,), m: along the axis; a touch that is not found counts as told in the middle."""
    around: Floats
    """(B,), m: round the limb, by the arc."""
    force: Floats
    """(B,), N: of the normal force."""
    detected: float
    """Share of the touches that were found as one."""

    @property
    def errors(self) -> dict[str, Floats]:
        """Errors by their printed names."""
        return {"X": self.along, "T": self.around, "force": self.force}


def touched(design: SkinDesign, table: ResponseTable, world: World) -> Touched:
    """Touch a made skin all over, anywhere, in a world."""
    exam = Exam(skins=(SEED,), pairs=0, world=world)
    twin = world.skin(design, SEED, None)
    _, (straight, _) = candidate(table, design, exam).enter(
        twin, np.random.default_rng([SEED, 0]), world
    )
    rng = np.random.default_rng([SEED, 12])
    parts = []
    for session in range(_SESSIONS):
        count = COUNT // _SESSIONS
        push = np.zeros((count, 1, 3))
        push[:, 0, 2] = -rng.uniform(*FORCES, count)
        where = rng.uniform(0, geometry(design).extent, (count, 1, 2))
        pressed = press(
            twin,
            Touches(position=where, force=push),
            float(rng.uniform(15.0, 35.0)),
            world,
            (SEED, 12, session),
        )
        parts.append(judge(straight, twin, pressed, rng))
    return _errors(world.name, together(parts))


def _errors(world: str, answers: Answers) -> Touched:
    """Errors of all touches, those that were missed among them."""
    missed = answers.extent / 2 - answers.truth[:, :2]
    off = np.abs(np.where(answers.detected[:, None], answers.error[:, :2], missed))
    return Touched(
        world=world,
        along=off[:, 0],
        around=off[:, 1],
        force=answers.force_error[:, 2],
        detected=float(answers.detected.mean()),
    )


def curved_rows(hard: Touched) -> list[Row]:
    """The printed means, beside those in the hard world."""
    print_of = {
        "X": "an average localization error in X direction of 2.05 mm",
        "T": "an average localization error in T direction of 3.68 mm",
        "force": "an average force estimation error of 0.063 N",
    }
    why = (
        f"made skin {SEED} of the design `curved`, 120 x 160 mm on a radius of 80 mm, in the hard "
        f"world, {100 * hard.detected:.1f} % of the touches found; holds where ours is not larger. "
        "The paper prints neither its skin's size nor the forces"
    )
    rows = []
    for letter, (name, errors) in zip("abc", hard.errors.items(), strict=True):
        mean, printed = float(errors.mean()), PRINTED[name]
        computed = f"{mean:.3f} N" if name == "force" else f"{1e3 * mean:.2f} mm"
        place = f"Text S9, Figure S12{letter}"
        rows.append(
            stated(f"figure_s12.{name}", place, print_of[name], computed, mean <= printed, why)
        )
    return rows


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S12a to S12c, on the shipped curved design and its table."""
    del setting  # that of the planar skin
    design, table = read_design("curved"), load_response_table("curved")
    return draw(*(touched(design, table, world_of(name)) for name in ("hard", "plain")))


def draw(hard: Touched, plain: Touched) -> Plate:
    """Three histograms, with both worlds' and the printed means."""
    with styled():
        figure = canvas(7.2, 2.4)
        axes = figure.subplots(1, 3)
        sides = zip("abc", hard.errors.items(), plain.errors.values(), axes, strict=True)
        for letter, (name, errors), easier, axis in sides:
            unit, scale = ("N", 1.0) if name == "force" else ("mm", 1e3)
            _draw_errors(axis, scale * errors, scale * easier, scale * PRINTED[name])
            axis.set(title=f"({letter}) {name}", xlabel=f"error ({unit})", ylabel="touches")
        axes[0].legend(handlelength=1.0)
        open_axes(*axes)
        lay_out(figure)
    means = {
        touches.world: f"{1e3 * touches.along.mean():.2f} mm, {1e3 * touches.around.mean():.2f} mm "
        f"and {touches.force.mean():.4f} N"
        for touches in (hard, plain)
    }
    return Plate(
        name="figure_s12",
        title="Figures S12a to S12c",
        caption=f"Figures S12a to S12c, on the twin: errors along the axis (X), round the limb (T) "
        f"and of the normal force in {COUNT} touches of {FORCES[0]:g} to {FORCES[1]:g} N anywhere "
        f"on made skin {SEED} of the design `curved` (twelve signals of four chips), calibrated by "
        f"60 labelled touches. In the hard world, with all that the twin's own assumptions leave "
        f"out but for a motor inside the limb, means are {means[hard.world]}; in the plain world "
        f"{means[plain.world]}. Dashed: the paper's means, 2.05 mm, 3.68 mm and 0.063 N, of a real "
        "skin whose size is not printed.",
        figure=figure,
        rows=tuple(curved_rows(hard)),
    )


def _draw_errors(axis: Axes, hard: Floats, plain: Floats, printed: float) -> None:
    """Errors in both worlds in the same classes, and the printed mean."""
    most = max(float(np.percentile(hard, 99)), 1.1 * printed)
    classes = np.linspace(0.0, most, 25)
    shown: Look = {"bins": classes, "alpha": 0.65}
    axis.hist(np.minimum(plain, most), color=GREY, label="plain world", **shown)
    axis.hist(np.minimum(hard, most), color=BLUE, label="hard world", **shown)
    axis.axvline(hard.mean(), color=INK, linewidth=1.0, label="its mean")
    axis.axvline(printed, color=ORANGE, linestyle="--", linewidth=1.2, label="mean, printed")


if __name__ == "__main__":
    plate(Setting()).show()
