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
from smoskin.origami.layout import magnet_positions
from smoskin.origami.sheet import loaded_positions

if TYPE_CHECKING:
    from rich.table import Table

LOCATION: Final = 1.2e-3
"""m: mean error of place that a calibrated skin is to reach."""
FORCE: Final = 0.05
"""Mean error of the normal force that it is to reach, as a share."""
LEVELS: Final = tuple(k / 20 for k in range(1, 20))
"""Stated confidences at which the observed one is told."""
_HALF: Final = 0.05
"""N: half a step of force."""


class Count(NamedTuple):
    """How readings of the same number of touches were told."""

    touches: int
    """True number."""
    readings: int
    right: float
    """Share told with that number."""
    unsure: float
    """Share where the estimator said that it could not tell."""

    @classmethod
    def of(cls, touches: int, said: Ints) -> "Count":
        """Of numbers said where there were so many."""
        return cls(touches, len(said), float((said == touches).mean()), float((said < 0).mean()))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceMap:
    """Means over skins and the headline's forces at each place of the grid; NaN where none is."""

    x: Floats
    """(L,), m."""
    y: Floats
    """(W,), m."""
    location: Floats
    """(L, W), m, error of the place."""
    force: Floats
    """(L, W), error of the normal force as a share."""

    def area(self, location: float, force: float) -> float:
        """Share of the pressed area on which both means stay below these."""
        weight = np.outer(*(_widths(line) for line in (self.x, self.y)))
        pressed = np.isfinite(self.location)
        good = pressed & (self.location <= location) & (self.force <= force)
        return float(weight[good].sum() / weight[pressed].sum())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One kind of touches, and how they were told."""

    name: str
    """`straight`; `undragged`, the same touches read by the estimator of dragged ones; `dragged`;
    or `pairs`."""
    marks: Marks
    """Of all forces."""
    headline: Tally
    levels: tuple[Tally, ...]
    """A force each; none for pairs."""
    regions: tuple[Tally, ...]
    """Of the headline's forces: rim, over magnets, inside."""
    confidence: Floats
    """(19, 2): observed share of places, and of normal forces, in the regions stated with each of
    the confidences `LEVELS`."""
    idle: Count
    """Of the untouched readings just before each touch."""
    touched: Count
    """Of the readings under touches, of all forces."""
    map: PlaceMap | None
    """None for pairs."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        rows = zip(LEVELS, self.confidence.tolist(), strict=True)
        shown = self.map
        return {
            "name": self.name,
            "headline": self.headline.as_json(),
            "by_force": [one.as_json() for one in self.levels],
            "by_region": [one.as_json() for one in self.regions],
            "confidence": [
                {"stated": stated, "place": place, "force": force}
                for stated, (place, force) in rows
            ],
            "counts": [one._asdict() for one in (self.idle, self.touched)],
            "area_percent": None if shown is None else _areas(shown),
            "map": None
            if shown is None
            else {
                "x_mm": (1e3 * shown.x).tolist(),
                "y_mm": (1e3 * shown.y).tolist(),
                "location_mm": _listed(1e3 * shown.location),
                "force_percent": _listed(100 * shown.force),
            },
        }


class Target(NamedTuple):
    """What was asked for, and what was reached."""

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
    """Of the file."""
    file_sha256: str
    chips: tuple[int, ...]
    exam: Exam
    cases: tuple[Case, ...]

    def case(self, name: str) -> Case | None:
        """The case of a name; None where it was not asked for."""
        return next((one for one in self.cases if one.name == name), None)

    def targets(self) -> list[Target]:
        """What the package sets itself, as far as it was asked for."""
        straight, dragged, pairs = (self.case(one) for one in ("straight", "dragged", "pairs"))
        rows: list[Target] = []
        if straight is not None:
            one = straight.headline
            rows += [
                Target("mean error of place", "mm", 1e3 * one.location.mean, None, 1e3 * LOCATION),
                Target("mean error of normal force", "%", 100 * one.force, None, 100 * FORCE),
                Target("90 % regions hold", "%", 100 * one.held.place, 85, 95),
                Target("told as one touch", "%", 100 * straight.touched.right, 97, 100),
                Target("told as none", "%", 100 * straight.idle.right, 97, 100),
            ]
            near = one.near
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
            "targets": [one._asdict() | {"met": one.met} for one in self.targets()],
            "cases": [one.as_json() for one in self.cases],
        }

    def tables(self) -> "list[Table]":
        """Figures of each case, and the targets, for people."""
        from rich.table import Table

        tables = []
        for case in self.cases:
            table = Table(title=f"{case.name}: {self.exam.skins} unseen skins")
            table.add_column("touches", no_wrap=True)
            for heading in _headings(case.headline):
                table.add_column(heading, justify="right")
            for one in (case.headline, *case.levels, *case.regions):
                table.add_row(*_cells(one))
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
    design : SkinDesign
    marks : Marks
        Of all forces.
    idle, touched : Count
        Of the untouched readings and of the touched ones.
    places : tuple of int or None
        Of the grid that was pressed, at the forces of the levels; None: anywhere, at any force.
    """
    pressed = -marks.truth[:, 4]
    chief = marks.where(pressed > HEADLINE - _HALF)
    levels = () if places is None else FORCES
    of_level = [(f"{force:.1f} N", np.abs(pressed - force) < _HALF) for force in levels]
    return Case(
        name=name,
        marks=marks,
        headline=tally(f"{HEADLINE:g} to {FORCES[-1]:g} N", chief),
        levels=tuple(tally(name, marks.where(rows)) for name, rows in of_level if rows.any()),
        regions=tuple(
            tally(name, chief.where(rows))
            for name, rows in regions(design, chief.truth[:, :2]).items()
            if rows.any()
        ),
        confidence=np.stack(
            [
                (chief.confidence(axes)[:, None] <= np.array(LEVELS)).mean(axis=0)
                for axes in ((0, 1), (4,))
            ],
            axis=1,
        ),
        idle=idle,
        touched=touched,
        map=None if places is None else _place_map(chief, places),
    )


def regions(design: SkinDesign, position: Floats) -> dict[str, Bools]:
    """Which places (B, 2) lie past the outermost vertices, near a magnet, or elsewhere."""
    vertices = loaded_positions(design)[..., :2]
    low, high = vertices[0, 0], vertices[-1, -1]
    rim = ((position < low) | (position > high)).any(axis=1)
    over = np.zeros(len(position), dtype=np.bool_)
    for magnet, middle in zip(design.magnets, magnet_positions(design), strict=True):
        away = np.hypot(*(position - middle[:2]).T)
        over |= ~rim & (away <= magnet.radius + FINGERTIP)
    return {"rim": rim, "over magnets": over, "inside": ~rim & ~over}


def _place_map(marks: Marks, places: tuple[int, int]) -> PlaceMap:
    """Means at each place of the grid."""
    flat = grid_places(marks.truth[:, :2], marks.extent, places)
    size = places[0] * places[1]
    visits = np.bincount(flat, minlength=size).astype(np.float64)
    visits[visits == 0] = np.nan
    location, force = (
        (np.bincount(flat, values, size) / visits).reshape(places)
        for values in (marks.distance, marks.force_error / -marks.truth[:, 4])
    )
    x, y = (np.linspace(0, end, n) for end, n in zip(marks.extent, places, strict=True))
    return PlaceMap(x=x, y=y, location=location, force=force)


def _widths(line: Floats) -> Floats:
    """Length that each place of a line stands for: at both ends half as much."""
    edges = np.concatenate([line[:1], (line[1:] + line[:-1]) / 2, line[-1:]])
    return np.diff(edges)


def _areas(shown: PlaceMap) -> dict[str, float]:
    """Shares of the area on which targets hold, %."""
    return {
        "location": 100 * shown.area(LOCATION, np.inf),
        "force": 100 * shown.area(np.inf, FORCE),
        "both": 100 * shown.area(LOCATION, FORCE),
    }


def _listed(values: Floats) -> list[list[float | None]]:
    """An array as lists, None where there is no value."""
    return [[v if np.isfinite(v) else None for v in row] for row in values.tolist()]


def _headings(one: Tally) -> list[str]:
    """Of the columns after the first of a table for people."""
    return [
        "found",
        "place (mm)",
        "median",
        "90 %",
        "RMS",
        "force",
        *(() if one.drag is None else ("drag",)),
        "held by 90 %",
        *(() if one.near is None else ("RMS / noise", "RMS / known")),
    ]


def _cells(one: Tally) -> list[str]:
    """A row of that table."""
    ratios = () if one.near is None else (one.near.noise, one.near.known)
    return [
        one.name,
        f"{one.found:.1%}",
        *(f"{1e3 * size:.2f}" for size in one.location),
        f"{one.force:.2%}",
        *(() if one.drag is None else (f"{one.drag:.1%}",)),
        f"{one.held.place:.1%}",
        *("" if ratio is None else f"{ratio:.2f}" for ratio in ratios),
    ]
