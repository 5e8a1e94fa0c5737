"""The sheet that an exam fills: figures by force and region, maps, confidence, targets."""

from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.commands.score.errors import Marks, Tally, grid_places, tally
from smoskin.commands.score.evaluate import FORCES
from smoskin.commands.score.plan import HEADLINE, Exam
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.origami.geometry import geometry

if TYPE_CHECKING:
    from rich.table import Table

LOCATION: Final = 1.2e-3
"""Mean error of place that a calibrated skin is to reach, m."""
FORCE: Final = 0.05
"""Mean error of the normal force that it is to reach, as a share."""
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

    x: Floats
    """(L,), m."""
    y: Floats
    """(W,), m."""
    location: Floats
    """(L, W), error of the place, m."""
    force: Floats
    """(L, W), error of the normal force as a share."""

    @classmethod
    def of(cls, marks: Marks, places: tuple[int, int]) -> "PlaceMap":
        """Means at each place of a grid of touches that stand on it."""
        flat = grid_places(marks.truth[:, :2], marks.extent, places)
        size = places[0] * places[1]
        visits = np.bincount(flat, minlength=size).astype(np.float64)
        visits[visits == 0] = np.nan
        location, force = (
            (np.bincount(flat, values, size) / visits).reshape(places)
            for values in (marks.distance, marks.force_error / -marks.truth[:, 4])
        )
        x, y = (np.linspace(0, end, n) for end, n in zip(marks.extent, places, strict=True))
        return cls(x=x, y=y, location=location, force=force)

    def area(self, location: float, force: float) -> float:
        """Share of the pressed area on which both means stay below these."""
        weight = np.outer(*(np.gradient(line) * _ends(len(line)) for line in (self.x, self.y)))
        pressed = np.isfinite(self.location)
        good = pressed & (self.location <= location) & (self.force <= force)
        return float(weight[good].sum() / weight[pressed].sum())

    def as_json(self) -> dict[str, object]:
        """Plain values for machines; None where there is no value."""

        def listed(values: Floats) -> list[list[float | None]]:
            return [[v if np.isfinite(v) else None for v in row] for row in values.tolist()]

        return {
            "x_mm": (1e3 * self.x).tolist(),
            "y_mm": (1e3 * self.y).tolist(),
            "location_mm": listed(1e3 * self.location),
            "force_percent": listed(100 * self.force),
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One kind of touches, and how they were told."""

    name: str
    """`straight`; `undragged`, the same touches read by the estimator of dragged ones; `dragged`;
    or `pairs`."""
    marks: Marks
    """Touches of all forces."""
    headline: Tally
    levels: tuple[Tally, ...]
    """Figures by force; none for pairs."""
    regions: tuple[Tally, ...]
    """Figures of the headline's forces by region: rim, over magnets, inside."""
    confidence: Floats
    """(19, 2): observed share of places, and of normal forces, in the regions stated with each of
    the confidences `LEVELS`."""
    idle: Count
    """Answers to the untouched readings just before each touch."""
    touched: Count
    """Answers to the readings under touches, of all forces."""
    map: PlaceMap | None
    """None for pairs."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        rows = zip(LEVELS, self.confidence.tolist(), strict=True)
        shown, least = self.map, {"location": (LOCATION, np.inf), "force": (np.inf, FORCE)}
        areas = least | {"both": (LOCATION, FORCE)}
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
            "area_percent": None
            if shown is None
            else {name: 100 * shown.area(*ends) for name, ends in areas.items()},
            "map": None if shown is None else shown.as_json(),
        }


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

    design: str
    design_hash: str
    kind: str
    """Kind of the file."""
    file_sha256: str
    """Hash of the file; empty where none was given."""
    chips: tuple[int, ...]
    exam: Exam
    cases: tuple[Case, ...]

    @property
    def met(self) -> bool:
        """Whether every target is."""
        return all(target.met for target in self.targets())

    def case(self, name: str) -> Case | None:
        """The case of a name; None where it was not asked for."""
        return next((case for case in self.cases if case.name == name), None)

    def targets(self) -> list[Target]:
        """The targets that the package sets itself, as far as they were asked for."""
        straight, dragged, pairs = (self.case(name) for name in ("straight", "dragged", "pairs"))
        rows: list[Target] = []
        if straight is not None:
            chief = straight.headline
            rows += [
                Target(
                    "mean error of place", "mm", 1e3 * chief.location.mean, None, 1e3 * LOCATION
                ),
                Target("mean error of normal force", "%", 100 * chief.force, None, 100 * FORCE),
                Target("90 % regions hold", "%", 100 * chief.held.place, 85, 95),
                Target("told as one touch", "%", 100 * straight.touched.right, 97, 100),
                Target("told as none", "%", 100 * straight.idle.right, 97, 100),
            ]
            near = chief.near
            if near is not None and near.noise is not None and near.known is not None:
                rows += [
                    Target("RMS over the bound by noise", "", near.noise, None, 1.5),
                    Target("RMS over the bound by what is known", "", near.known, None, 1.5),
                ]
        two = None if dragged is None else dragged.headline
        if two is not None and two.drag is not None:
            for name in ("undragged", "straight"):
                other = self.case(name)
                if other is not None:
                    ratio = two.location.mean / other.headline.location.mean
                    rows.append(Target(f"dragged: place over {name}", "", ratio, None, 1.5))
            rows += [
                Target("dragged: error of the drag", "%", 100 * two.drag, None, 5),
                Target("dragged: 90 % regions hold", "%", 100 * two.held.place, 85, 95),
            ]
        if pairs is not None:
            both = pairs.headline
            rows += [
                Target("pairs: told as two touches", "%", 100 * pairs.touched.right, 97, 100),
                Target("pairs: mean error of place", "mm", 1e3 * both.location.mean, None, 5),
            ]
        return rows

    def as_json(self) -> dict[str, object]:
        """Plain values for machines: what score.json holds."""
        return {
            "smoskin": version("smoskin"),
            "design": {"name": self.design, "sha256": self.design_hash},
            "file": {"kind": self.kind, "sha256": self.file_sha256, "chips": list(self.chips)},
            "exam": self.exam.as_json(),
            "targets": [target._asdict() | {"met": target.met} for target in self.targets()],
            "cases": [case.as_json() for case in self.cases],
        }

    def tables(self) -> "list[Table]":
        """Figures of each case, and the targets, for people."""
        from rich.table import Table

        tables = []
        for case in self.cases:
            rows = [_row(part) for part in (case.headline, *case.levels, *case.regions)]
            table = Table(title=f"{case.name}: {len(self.exam.skins)} unseen skins")
            for heading in rows[0]:
                first = heading == "touches"
                table.add_column(heading, justify="left" if first else "right", no_wrap=first)
            for row in rows:
                table.add_row(*(row.get(heading, "") for heading in rows[0]))
            tables.append(table)
        table = Table("target", title="Targets")
        for heading in ("reached", "asked", ""):
            table.add_column(heading, justify="right")
        for target in self.targets():
            asked = f"{target.most:g}"
            asked = f"<= {asked}" if target.least is None else f"{target.least:g} to {asked}"
            table.add_row(
                target.name,
                f"{target.reached:.2f} {target.unit}".rstrip(),
                f"{asked} {target.unit}".rstrip(),
                "met" if target.met else "missed",
                style="" if target.met else "red",
            )
        return [*tables, table]


def case_of(
    name: str,
    design: SkinDesign,
    marks: Marks,
    *,
    idle: Count,
    touched: Count,
    places: tuple[int, int] | None,
) -> Case:
    """A case with its figures.

    Parameters
    ----------
    name : str
        Name of the case.
    design : SkinDesign
        Design of the skins.
    marks : Marks
        Touches of all forces.
    idle, touched : Count
        Answers to the untouched readings and to the touched ones.
    places : tuple of int or None
        Grid that was pressed, at the forces of the levels; None: anywhere, at any force.
    """
    normal = -marks.truth[:, 4]
    chief = marks.where(normal > HEADLINE - _HALF)
    levels = () if places is None else FORCES
    of_level = [(f"{force:.1f} N", np.abs(normal - force) < _HALF) for force in levels]
    parted = regions(design, chief.truth[:, :2])
    stated = [chief.confidence(axes)[:, None] <= np.array(LEVELS) for axes in ((0, 1), (4,))]
    return Case(
        name=name,
        marks=marks,
        headline=tally(f"{HEADLINE:g} to {FORCES[-1]:g} N", chief),
        levels=tuple(tally(label, marks.where(rows)) for label, rows in of_level if rows.any()),
        regions=tuple(
            tally(label, chief.where(rows)) for label, rows in parted.items() if rows.any()
        ),
        confidence=np.stack([inside.mean(axis=0) for inside in stated], axis=1),
        idle=idle,
        touched=touched,
        map=None if places is None else PlaceMap.of(chief, places),
    )


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


def _ends(count: int) -> Floats:
    """Weights of the places of a line: at both ends, which stand for half a step, a half."""
    weights = np.ones(count)
    weights[[0, -1]] = 0.5
    return weights


def _row(part: Tally) -> dict[str, str]:
    """A row of a table for people, by its headings."""
    place = dict(zip(("place (mm)", "median", "90 %", "RMS"), part.location, strict=True))
    row = {"touches": part.name, "found": f"{part.found:.1%}"}
    row |= {heading: f"{1e3 * size:.2f}" for heading, size in place.items()}
    row["force"] = f"{part.force:.2%}"
    if part.drag is not None:
        row["drag"] = f"{part.drag:.1%}"
    row["held by 90 %"] = f"{part.held.place:.1%}"
    if part.near is not None:
        ratios = {"RMS / noise": part.near.noise, "RMS / known": part.near.known}
        row |= {head: "" if ratio is None else f"{ratio:.2f}" for head, ratio in ratios.items()}
    return row
