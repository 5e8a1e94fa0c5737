"""The sheet that an exam fills: figures by force and region, maps, confidence, targets."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.commands.score.errors import Answers, Tally, tally
from smoskin.commands.score.evaluate import FORCES, HEADLINE, Exam
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.origami.geometry import geometry

if TYPE_CHECKING:
    from rich.table import Table

LOCATION: Final = 1.2e-3
"""Mean error of place that a calibrated skin is to reach in the plain world, m."""
FORCE: Final = 0.05
"""Mean error of the normal force that it is to reach there, as a share."""
_HARD_LOCATION: Final = (1.3e-3, 1.0e-3)
"""Mean error of place that it is to reach in any other world, with two chips and with more, m."""
_HARD_DRAGGED: Final = 1.5e-3
"""The same of dragged touches, m."""
_HARD_FORCE: Final = 0.03
"""Mean error of the normal force that it is to reach there, as a share."""
LEVELS: Final = tuple(k / 20 for k in range(1, 20))
"""Stated confidences at which the observed one is told."""
_HALF: Final = 0.05
"""Half a step of force, N."""


class Count(NamedTuple):
    """How readings of the same number of touches were told."""

    touches: int
    """True number of touches."""
    readings: int
    right: float
    """Share told with that number."""
    unsure: float
    """Share where the estimator could not tell."""

    @classmethod
    def of(cls, touches: int, counts: Ints) -> "Count":
        """Shares of the numbers that were told of so many touches; -1 where none could be."""
        right, unsure = (counts == touches).mean(), (counts < 0).mean()
        return cls(touches, len(counts), float(right), float(unsure))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceMap:
    """Means over skins and the headline's forces at each place of the grid; NaN where none is."""

    extent: Floats
    """Size of the skin, (2,), m."""
    location: Floats
    """Error of the place, (L, W), m."""
    force: Floats
    """Error of the normal force as a share, (L, W)."""

    def area(self, location: float, force: float) -> float:
        """Share of the pressed area on which both means stay below these."""
        # A place on a rim stands for half a step, one in a corner for a quarter.
        weight = np.ones(self.location.shape)
        weight[[0, -1]] *= 0.5
        weight[:, [0, -1]] *= 0.5
        pressed = np.isfinite(self.location)
        good = pressed & (self.location <= location) & (self.force <= force)
        return float(weight[good].sum() / weight[pressed].sum())

    def as_json(self) -> dict[str, object]:
        """Plain values for machines; None where there is no value."""

        def listed(values: Floats) -> list[list[float | None]]:
            return [[v if np.isfinite(v) else None for v in row] for row in values.tolist()]

        x, y = (
            np.linspace(0, end, n) for end, n in zip(self.extent, self.location.shape, strict=True)
        )
        return {
            "x_mm": (1e3 * x).tolist(),
            "y_mm": (1e3 * y).tolist(),
            "location_mm": listed(1e3 * self.location),
            "force_percent": listed(100 * self.force),
        }


def grid_places(position: Floats, extent: Floats, places: tuple[int, int]) -> Ints:
    """Which of a grid's places, row by row, each position (B, 2) is, (B,)."""
    cells = np.rint(position / extent * (np.array(places) - 1)).astype(np.int64)
    return np.asarray(np.ravel_multi_index((cells[:, 0], cells[:, 1]), places), np.int64)


def place_map(answers: Answers, places: tuple[int, int]) -> PlaceMap:
    """Means at each place of a grid of touches that stand on it."""
    flat = grid_places(answers.truth[:, :2], answers.extent, places)
    size = places[0] * places[1]
    visits = np.bincount(flat, minlength=size).astype(np.float64)
    visits[visits == 0] = np.nan
    location, force = (
        (np.bincount(flat, values, size) / visits).reshape(places)
        for values in (answers.distance, answers.force_error[:, 2] / -answers.truth[:, 4])
    )
    return PlaceMap(extent=answers.extent, location=location, force=force)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One kind of touches, and how they were told."""

    name: str
    """`straight`; `undragged`, the same touches read by the estimator of dragged ones; `dragged`;
    `pairs`, or `pairs in turn`, whose touches land one after the other."""
    answers: Answers
    """Answers to touches of all forces."""
    headline: Tally
    levels: tuple[Tally, ...]
    """Figures by force; none for pairs."""
    regions: tuple[Tally, ...]
    """Figures of the headline's forces by region: rim, over magnets, inside."""
    confidence: Floats
    """Observed share of places, and of normal forces, in the regions stated with each of the
    confidences `LEVELS`, (19, 2)."""
    idle: Count
    """Answers to the untouched readings just before each touch."""
    touched: Count
    """Answers to the readings under touches, of all forces."""
    map: PlaceMap | None
    """None for pairs."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        rows = zip(LEVELS, self.confidence.tolist(), strict=True)
        shown, ends = self.map, {"location": (LOCATION, np.inf), "force": (np.inf, FORCE)}
        ends["both"] = (LOCATION, FORCE)
        return {
            "name": self.name,
            "headline": self.headline.as_json(),
            "by_force": [part.as_json() for part in self.levels],
            "by_region": [part.as_json() for part in self.regions],
            "confidence": [
                {"stated": stated, "place": place, "force": force}
                for stated, (place, force) in rows
            ],
            "counts": [count._asdict() for count in (self.idle, self.touched)],
            "area_percent": shown
            and {name: 100 * shown.area(*most) for name, most in ends.items()},
            "map": shown and shown.as_json(),
        }


def case_of(name: str, design: SkinDesign, answers: Answers, exam: Exam) -> Case:
    """A case with its figures, of all its answers: one touch at once on the grid, or pairs."""
    normal, touches = -answers.truth[:, 4], len(answers.truth) // len(answers.count)
    chief = answers.where(normal > HEADLINE - _HALF)
    alone = touches == 1
    levels = {f"{force:.1f} N": np.abs(normal - force) < _HALF for force in FORCES if alone}
    parted = regions(design, chief.truth[:, :2])
    stated = [chief.confidence(axes)[:, None] <= np.array(LEVELS) for axes in ((0, 1), (4,))]
    return Case(
        name=name,
        answers=answers,
        headline=tally(f"{HEADLINE:g} to {FORCES[-1]:g} N", chief),
        levels=_tallies(answers, levels),
        regions=_tallies(chief, parted),
        confidence=np.stack([inside.mean(axis=0) for inside in stated], axis=1),
        idle=Count.of(0, answers.idle),
        touched=Count.of(touches, answers.count),
        map=place_map(chief, exam.places) if alone else None,
    )


def _tallies(answers: Answers, groups: dict[str, Bools]) -> tuple[Tally, ...]:
    """Figures of each group of touches that has any."""
    return tuple(tally(name, answers.where(rows)) for name, rows in groups.items() if rows.any())


def regions(design: SkinDesign, position: Floats) -> dict[str, Bools]:
    """Which places (B, 2) lie past the outermost vertices, near a magnet, or elsewhere."""
    vertices = geometry(design).tops[..., :2]
    low, high = vertices[0, 0], vertices[-1, -1]
    rim = ((position < low) | (position > high)).any(axis=1)
    over = np.zeros(len(position), dtype=np.bool_)
    for magnet, middle in zip(design.magnets, geometry(design).magnets, strict=True):
        away = np.hypot(*(position - middle[:2]).T)
        over |= ~rim & (away <= magnet.radius + FINGERTIP)
    return {"rim": rim, "over magnets": over, "inside": ~rim & ~over}


class Target(NamedTuple):
    """A figure that was asked for, and what was reached."""

    name: str
    unit: str
    reached: float
    least: float | None
    most: float

    @property
    def met(self) -> bool:
        """Whether it lies within."""
        return (self.least is None or self.reached >= self.least) and self.reached <= self.most


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoreSheet:
    """Everything that an exam has found."""

    design: SkinDesign
    kind: str
    """Kind of the file."""
    file_sha256: str
    """Hash of the file; empty where none was given."""
    chips: tuple[int, ...]
    exam: Exam
    cases: tuple[Case, ...]
    sent_back: tuple[int, ...] = ()
    """Seeds of skins of which a chip is at the end of its range untouched; none is judged."""

    @property
    def met(self) -> bool:
        """Whether every target is."""
        return all(target.met for target in self.targets())

    def verdict(self) -> str:
        """What the exit code says, in a sentence."""
        targets = self.targets()
        missed = [target.name for target in targets if not target.met]
        if not missed:
            return f"All {len(targets)} targets are met: exit code 0."
        names = ", ".join(missed)
        return f"{len(missed)} of {len(targets)} targets are missed ({names}): exit code 1."

    def case(self, name: str) -> Case | None:
        """The case of a name; None where it was not asked for."""
        return next((case for case in self.cases if case.name == name), None)

    def targets(self) -> list[Target]:
        """The targets that the package sets itself in this world, as far as they were asked for."""
        rows: list[Target] = []
        plain = self.exam.world.plain
        location = LOCATION if plain else _HARD_LOCATION[len(self.chips) > 2]
        force, least = (FORCE, 97) if plain else (_HARD_FORCE, 99)
        straight, dragged = self.case("straight"), self.case("dragged")
        if straight is not None:
            chief = straight.headline
            place, near = 1e3 * chief.location.mean, chief.near
            rows += [
                Target("mean error of place", "mm", place, None, 1e3 * location),
                Target("mean error of normal force", "%", 100 * chief.force, None, 100 * force),
                Target("90 % regions hold", "%", 100 * chief.held.place, 85, 95),
                Target("told as one touch", "%", 100 * straight.touched.right, least, 100),
                Target("told as none", "%", 100 * straight.idle.right, least, 100),
            ]
            # A bound by what is known holds where nothing else goes on.
            if plain and near is not None and near.noise is not None and near.known is not None:
                rows += [
                    Target("RMS over the bound by noise", "", near.noise, None, 1.5),
                    Target("RMS over the bound by what is known", "", near.known, None, 1.5),
                ]
        if dragged is not None and (drag := dragged.headline.drag) is not None:
            chief = dragged.headline
            place = 1e3 * chief.location.mean
            if not plain:
                most = 1e3 * _HARD_DRAGGED
                rows.append(Target("dragged: mean error of place", "mm", place, None, most))
            for name in ("undragged", "straight"):
                if plain and (other := self.case(name)) is not None:
                    ratio = chief.location.mean / other.headline.location.mean
                    rows.append(Target(f"dragged: place over {name}", "", ratio, None, 1.5))
            rows += [
                Target("dragged: error of the drag", "%", 100 * drag, None, 5),
                Target("dragged: 90 % regions hold", "%", 100 * chief.held.place, 85, 95),
            ]
        for pairs in filter(None, map(self.case, ("pairs", "pairs in turn"))):
            place, right = 1e3 * pairs.headline.location.mean, 100 * pairs.touched.right
            rows += [
                Target(f"{pairs.name}: told as two touches", "%", right, 97, 100),
                Target(f"{pairs.name}: mean error of place", "mm", place, None, 5),
            ]
        return rows

    def as_json(self) -> dict[str, object]:
        """Plain values for machines: what score.json holds."""
        return {
            "smoskin": version("smoskin"),
            "design": {"name": self.design.name, "sha256": self.design.content_hash},
            "file": {"kind": self.kind, "sha256": self.file_sha256, "chips": list(self.chips)},
            "exam": self.exam.as_json(),
            "sent_back": list(self.sent_back),
            "targets": [target._asdict() | {"met": target.met} for target in self.targets()],
            "cases": [case.as_json() for case in self.cases],
        }

    def tables(self) -> "list[Table]":
        """Figures of each case, and the targets, for people."""
        judged = len(self.exam.skins) - len(self.sent_back)
        of = f"{judged} unseen skins, {self.exam.world.name} world"
        if self.sent_back:
            of += f" (out of range untouched, sent back: {', '.join(map(str, self.sent_back))})"
        return [
            *(
                _table(
                    f"{case.name}: {of}",
                    [_row(part) for part in (case.headline, *case.levels, *case.regions)],
                )
                for case in self.cases
            ),
            _table("Targets", [_target_row(target) for target in self.targets()]),
        ]


def _table(title: str, rows: Sequence[dict[str, str]]) -> "Table":
    """A table for people, with the first row's headings; a target that was missed is red."""
    from rich.table import Table

    table = Table(title=title)
    for column, heading in enumerate(rows[0]):
        table.add_column(heading, justify="right" if column else "left", no_wrap=not column)
    for row in rows:
        style = "red" if "missed" in row.values() else ""
        table.add_row(*(row.get(heading, "") for heading in rows[0]), style=style)
    return table


def _target_row(target: Target) -> dict[str, str]:
    """A target by the headings of its table."""
    most = f"{target.most:g}"
    asked = f"<= {most}" if target.least is None else f"{target.least:g} to {most}"
    return {
        "target": target.name,
        "reached": f"{target.reached:.2f} {target.unit}".rstrip(),
        "asked": f"{asked} {target.unit}".rstrip(),
        "": "met" if target.met else "missed",
    }


def _row(part: Tally) -> dict[str, str]:
    """Figures of some touches by the headings of their table."""
    place = dict(zip(("place (mm)", "median", "90 %", "RMS"), part.location, strict=True))
    row = {"touches": part.name, "found": f"{part.detected:.1%}"}
    row |= {heading: f"{1e3 * size:.2f}" for heading, size in place.items()}
    row["force"] = f"{part.force:.2%}"
    if part.drag is not None:
        row["drag"] = f"{part.drag:.1%}"
    row["held by 90 %"] = f"{part.held.place:.1%}"
    if part.near is not None:
        ratios = {"RMS / noise": part.near.noise, "RMS / known": part.near.known}
        row |= {head: "" if ratio is None else f"{ratio:.2f}" for head, ratio in ratios.items()}
    return row
