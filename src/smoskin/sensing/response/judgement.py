"""Judgement of labelled touches: whether they fit a skin of the design, and what is wrong if not.

Decides which mistakes of a sheet are looked for (units, signs, chips, axes, rows, origin), how much
likelier one must make the touches to be named, and what people are warned of. Equations: "Judged
touches" in `docs/derivations.md`.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import CalibrationError
from smoskin.sensing.response.calibrate import LabelledTouches, label_noise
from smoskin.sensing.response.evidence import STRETCHES, Evidence, LeftOut
from smoskin.sensing.response.table import ResponseTable

_NAMED: Final = 30.0
"""Logarithm of how much likelier a mistake must make the touches; good ones reach 12."""
_HINTED: Final = 8.0
"""The same from which people are warned of it."""
_ODD: Final = 100.0
"""The same of one touch whose label is wrong, above which it is refused; below, people are warned:
one place of a made skin may fit badly, by up to 62."""
_POOR: Final = 2.0
"""Factor below which touches fit; where a mistake leaves less, no other is looked for."""
_UNFIT: Final = 16.0
"""Factor on the misfit's deviation from which no skin of the design is believed in; good touches
reach 4."""
_DOUBTED: Final = 8.0
"""Factor from which people are warned."""
_WORSE: Final = 3.0
"""Ratio of one chip's residuals to the median's from which people are warned."""
_FEW: Final = 5
"""Touches below which a judgement is worth little."""
_SUSPECTS: Final = 12
"""Touches that may have exchanged their labels: those that fit worst."""
_DRAG: Final = 0.3
"""Standard deviation of drags for one who locates the touches, N."""
_DRAGGED: Final = 0.05
"""Drag from which its sign is looked at, N."""
_OFF_SKIN: Final = 5e-3
"""Distance by which true places may lie off the skin, m."""
_BELIEVABLE: Final = (0.02, 6.0)
"""Largest forces of a sheet that a person can have pressed with, N."""
_SHIFTS: Final = np.linspace(-20e-3, 20e-3, 7)
"""Shifts of the origin along each axis that are tried first, m."""
_STEPS: Final = (3.3e-3, 1.7e-3, 0.8e-3)
"""Steps of the search from there, m."""
_SAMPLE: Final = 20
"""Touches with which it is made."""

FIELDS: Final = {
    1e3: "fields seem to be 1000 times too small: in mT where uT must stand?",
    1e-3: "fields seem to be 1000 times too large: in nT where uT must stand?",
    1e6: "fields seem to be a million times too small: in T where uT must stand?",
    1e-6: "fields seem to be a million times too large",
    1e2: "fields seem to be 100 times too small: in gauss where uT must stand?",
    1e-2: "fields seem to be 100 times too large",
    1e1: "fields seem to be 10 times too small",
    1e-1: "fields seem to be 10 times too large: in mG where uT must stand?",
    -1.0: "fields seem to have the wrong sign",
}
"""What seems wrong, by the factor that mends it."""
FORCES: Final = {
    1e3: "forces seem to be 1000 times too small: in kN where N must stand?",
    1e-3: "forces seem to be 1000 times too large: in mN where N must stand?",
    2.0: "forces seem to be half as large as they were",
    0.5: "forces seem to be twice as large as they were",
    9.80665: "forces seem to be 9.8 times too small: in kgf where N must stand?",
    9.80665e-3: "forces seem to be 102 times too large: in gf where N must stand?",
}
DRAGS: Final = {
    (-1, 1): "forces along x seem to have the wrong sign",
    (1, -1): "forces along y seem to have the wrong sign",
    (-1, -1): "forces along x and y seem to have the wrong sign",
}


class Suspicion(NamedTuple):
    """A mistake that would explain the touches."""

    sentence: str
    """What seems to be wrong."""
    gain: float
    """Logarithm of how much likelier it makes them."""
    stretch: float
    """Factor on the design's misfit with which it does so best."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judgement:
    """What N labelled touches tell of each other."""

    stretch: float
    """Factor on the design's misfit with which the touches are likeliest."""
    squared: Floats
    """(N,): squared length, in standard deviations, of what each reads less what all others
    foretell; C on average."""
    residual: Floats
    """(N, C): the same for each signal."""
    errors: Floats
    """(N, 5), m and N: x, y, Fx, Fy and Fz at which the others locate each touch, less its label;
    one step of the estimator's descent."""
    suspicion: Suspicion | None
    """Mistake that explains the touches far better than the sheet as it stands."""
    warnings: tuple[str, ...]
    """Milder things."""

    @property
    def place_error(self) -> float:
        """Cross-validated error of place, root mean square, m; the labels' own is part of it."""
        return float(np.sqrt((self.errors[:, :2] ** 2).sum(axis=1).mean()))

    @property
    def force_error(self) -> float:
        """Cross-validated error of the normal force, root mean square, N."""
        return float(np.sqrt((self.errors[:, 4] ** 2).mean()))

    @property
    def refusal(self) -> str | None:
        """Why no table may be made of the touches; None where one may."""
        if self.suspicion is not None:
            return self.suspicion.sentence
        if self.stretch < _UNFIT:
            return None
        return f"they miss what a skin of this design reads by {self.stretch:.0f} times its scatter"

    def check(self) -> None:
        """Raise `CalibrationError` if no table may be made of the touches."""
        if self.refusal is not None:
            raise CalibrationError(
                f"touches must fit a skin of the design: {self.refusal} (mend them, or accept the "
                "bad fit: --accept-bad-fit, accept_bad_fit=True)"
            )

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        return {
            "cross_validated_place_error_mm": round(1e3 * self.place_error, 4),
            "cross_validated_force_error_N": round(self.force_error, 5),
            "misfit_over_design": self.stretch,
            "refusal": self.refusal,
            "warnings": list(self.warnings),
        }


def judge_touches(
    table: ResponseTable,
    touches: LabelledTouches,
    noise: Floats,
    *,
    turns: Floats | None = None,
    rows: Sequence[int] | None = None,
) -> Judgement:
    """Judge touches by each other before a table is made of them.

    Parameters
    ----------
    table : ResponseTable
        Table of the design, with modes.
    touches : LabelledTouches
    noise : Floats, shape (C, C)
        Covariance of the signals' noise, T^2.
    turns : Floats, shape (S, 3, 3), optional
        Rotation of each chip's axes to the skin's; none by default.
    rows : sequence of int, optional
        Numbers of the rows that the touches stand in; else they are counted from 1.
    """
    flat = touches.signals.reshape(len(touches), -1)
    try:
        evidence = Evidence(table, touches, noise)
    except np.linalg.LinAlgError:  # forces or places from nowhere
        return _hopeless(table, touches)
    given = evidence.of(flat[None])[0]
    stretch = int(given.argmax())
    left = evidence.left_out(flat, stretch)
    names = [f"touch {n}" for n in range(1, len(touches) + 1)]
    if rows is not None:
        names = [f"row {row}" for row in rows]
    mistakes = _Mistakes(table, touches, noise, left, names)
    axes = np.tile(np.eye(3), (len(table.chips), 1, 1)) if turns is None else turns
    likeliest = float(given.max())
    best = Suspicion("", likeliest, np.inf)
    for some in (mistakes.of_signals(evidence, axes), mistakes.of_labels(), mistakes.of_origin()):
        best = max([best, *some], key=lambda suspicion: suspicion.gain)
        if best.stretch < _POOR and best.gain > likeliest + _NAMED:
            break
    warnings = []
    if len(touches) >= _FEW:
        odd = mistakes.of_one(evidence)
        if odd.gain > max(best.gain, likeliest + _ODD):
            best = odd
        elif odd.gain > likeliest + _NAMED:
            warnings = [odd.sentence]
    best = best._replace(gain=best.gain - likeliest)
    if _HINTED < best.gain <= _NAMED:
        warnings.append(f"perhaps {best.sentence}")
    spread = np.sqrt(np.einsum("ncc->nc", left.covariance))
    factor = float(STRETCHES[stretch])
    residual = left.residual / spread
    return Judgement(
        stretch=factor,
        squared=left.squared,
        residual=residual,
        errors=_located(table, touches, left),
        suspicion=best if best.gain > _NAMED else None,
        warnings=(*warnings, *_warnings(table, touches, residual, factor)),
    )


class _Mistakes(NamedTuple):
    """Sheets that may have been meant; each has the logarithm of its likelihood as gain."""

    table: ResponseTable
    touches: LabelledTouches
    noise: Floats
    left: LeftOut
    names: Sequence[str]

    def of_signals(self, evidence: Evidence, turns: Floats) -> Iterator[Suspicion]:
        """Mistakes in what the chips read, and labels that belong to other signals."""
        signals = self.touches.signals
        n, s, _ = signals.shape
        tried = [(FIELDS[c], c * signals, n * s * 3 * np.log(abs(c))) for c in FIELDS]
        own = np.einsum("sji,nsj->nsi", turns, signals)  # in each chip's own axes
        for order in itertools.permutations(range(s)):
            if order != tuple(range(s)):
                moved = np.einsum("sij,nsj->nsi", turns, own[:, order])
                tried.append((exchanged(order), moved, 0.0))
        for columns, matrix in chip_axes():
            turned = np.einsum("sij,nsj->nsi", turns, own @ matrix.T)
            where = f"Bx, By and Bz seem to stand in the columns {columns}"
            tried.append((f"{where} of every chip", turned, 0.0))
            for chip in range(s):
                single = np.array(signals)
                single[:, chip] = turned[:, chip]
                name = self.table.chips[chip] + 1
                tried.append((f"{where} of chip {name}", single, 0.0))
        for i, j in self._pairs(_SUSPECTS):
            swapped = np.array(signals)
            swapped[[i, j]] = signals[[j, i]]
            tried.append((f"{self._both(i, j)} seem to have exchanged their labels", swapped, 0.0))
        sets = np.array([trial[1] for trial in tried]).reshape(len(tried), n, -1)
        volumes = np.array([trial[2] for trial in tried])
        gains = evidence.of(sets) + volumes[:, None]
        yield from map(_suspicion, [trial[0] for trial in tried], gains)

    def of_one(self, evidence: Evidence) -> Suspicion:
        """The touch whose label is likeliest to be wrong."""
        signals = self.touches.signals.reshape(len(self.touches), -1)
        odd = evidence.without_label(signals)
        row = int(odd.max(axis=1).argmax())
        return _suspicion(f"{self.names[row]} does not fit the others", odd[row])

    def of_labels(self) -> Iterator[Suspicion]:
        """Mistakes in places and forces."""
        place, force, extent = self.touches.position, self.touches.force, self.table.basis.extent
        tried = [(text, place, c * force) for c, text in FORCES.items()]
        if np.abs(force[:, :2]).max() > _DRAGGED:
            tried += [(text, place, force * [*sign, 1]) for sign, text in DRAGS.items()]
            tried += [("forces along x and y seem exchanged", place, force[:, [1, 0, 2]])]
        tried += [(text, turned, force) for text, turned in turned_places(place, extent)]
        tried += [
            ("x and y of the places seem exchanged", place[:, ::-1], force),
            ("places seem to be 10 times too small: in cm where mm must stand?", 10 * place, force),
        ]
        for i, j in self._pairs(4):
            swapped = np.array(place)
            swapped[[i, j]] = place[[j, i]]
            tried.append((f"{self._both(i, j)} seem to have exchanged places", swapped, force))
        believed = []
        for text, places, forces in tried:
            on_skin = (places >= -_OFF_SKIN) & (places <= extent + _OFF_SKIN)
            if on_skin.all() and _BELIEVABLE[0] <= -forces[:, 2].min() <= _BELIEVABLE[1]:
                believed.append((text, replace(self.touches, position=places, force=forces)))
        if not believed:
            return
        gains = self._likelihoods([touches for _, touches in believed])
        yield from map(_suspicion, [text for text, _ in believed], gains)

    def of_origin(self) -> Iterator[Suspicion]:
        """The likeliest other origin: by a grid, then step by step."""
        touches = self.touches
        if len(touches) < _FEW:
            return
        some = slice(None, None, -(-len(touches) // _SAMPLE))
        few = replace(
            touches,
            position=touches.position[some],
            force=touches.force[some],
            signals=touches.signals[some],
            temperature=touches.temperature[some],
        )
        shift = np.zeros(2)
        for steps in (_SHIFTS, *(np.array([0.0, -step, step]) for step in _STEPS)):
            shifts = [shift + step for step in itertools.product(steps, steps)]
            moved = [replace(few, position=few.position + offset) for offset in shifts]
            shift = shifts[int(self._likelihoods(moved).max(axis=1).argmax())]
        x, y = -1e3 * shift
        text = f"the origin of the places seems shifted by ({x:.1f}, {y:.1f}) mm"
        whole = replace(touches, position=touches.position + shift)
        yield _suspicion(text, self._likelihoods([whole])[0])

    def _likelihoods(self, sets: Sequence[LabelledTouches]) -> Floats:
        """Logarithms of the likelihoods (H, F) of the signals with each of H sets of labels."""
        signals = sets[0].signals.reshape(1, len(sets[0]), -1)
        evidences = Evidence.of_sets(self.table, sets, self.noise)
        none = np.full(len(STRETCHES), -np.inf)
        return np.array(
            [none if evidence is None else evidence.of(signals)[0] for evidence in evidences]
        )

    def _pairs(self, count: int) -> Iterator[tuple[int, int]]:
        """Pairs of the touches that fit worst."""
        worst = np.argsort(-self.left.squared)[:count]
        return itertools.combinations(sorted(worst.tolist()), 2)

    def _both(self, i: int, j: int) -> str:
        word = self.names[i].split()[0].replace("touch", "touche")
        return f"{word}s {self.names[i].split()[1]} and {self.names[j].split()[1]}"


def _suspicion(sentence: str, likelihoods: Floats) -> Suspicion:
    """A mistake that makes touches so likely, (F,), with each stretch."""
    best = int(likelihoods.argmax())
    return Suspicion(sentence, float(likelihoods[best]), float(STRETCHES[best]))


def turned_places(place: Floats, extent: Floats) -> Iterator[tuple[str, Floats]]:
    """Places (N, 2), m, that were meant where axes run the other way on a skin of this extent."""
    yield "x seems to run the other way", place * [-1, 1] + extent * [1, 0]
    yield "y seems to run the other way", place * [1, -1] + extent * [0, 1]
    yield "places seem to be turned by 180 degrees", extent - place


def chip_axes() -> Iterator[tuple[str, Floats]]:
    """Orders and signs of a chip's axes: columns in which x, y and z stand, and what mends it."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if not np.array_equal(matrix, np.eye(3)):
                columns = ", ".join(
                    "-" * (sign < 0) + f"B{'xyz'[axis]}"
                    for axis, sign in zip(order, signs, strict=True)
                )
                yield f"({columns})", matrix


def exchanged(order: tuple[int, ...]) -> str:
    """In words which chips' columns stand in whose place."""
    moved = [chip + 1 for chip, other in enumerate(order) if chip != other]
    if len(moved) == 2:
        return f"chips {moved[0]} and {moved[1]} seem exchanged"
    places = ", ".join(str(chip + 1) for chip in order)
    return f"chips 1 to {len(order)} seem to stand in the columns of chips {places}"


def _located(table: ResponseTable, touches: LabelledTouches, left: LeftOut) -> Floats:
    """Errors (N, 5) of each touch, located from what the others foretell by one step."""
    slopes = table.slopes(touches.position, touches.force)
    spreads = touches.place_spread, touches.force_spread
    own = label_noise(table, touches.position, touches.force, spreads)
    weighed = np.swapaxes(slopes, 1, 2) @ np.linalg.inv(left.covariance - own)
    before = np.diag([*12 / table.basis.extent**2, _DRAG**-2, _DRAG**-2, 0.0])
    steps = np.linalg.solve(weighed @ slopes + before, weighed @ left.residual[..., None])
    return np.asarray(steps[..., 0])


def _warnings(
    table: ResponseTable, touches: LabelledTouches, residual: Floats, stretch: float
) -> Iterator[str]:
    """What is odd without being wrong."""
    if stretch >= _DOUBTED:
        yield f"the touches fit {stretch:.0f} times worse than skins of this design should"
    if len(touches) < _FEW:
        yield f"{len(touches)} touches are too few to be judged by each other; {_FEW} would do"
    parts = np.sqrt((residual.reshape(len(touches), -1, 3) ** 2).mean(axis=(0, 2)))
    for chip, size in zip(table.chips, parts, strict=True):
        if len(touches) >= _FEW and size > _WORSE * max(float(np.median(parts)), 1.0):
            yield f"chip {chip + 1} fits {size / np.median(parts):.1f} times worse than the others"
    middle = table.basis.extent / 2
    for name, sign in (("x", -1), ("x", 1)) if len(touches) >= _FEW else ():
        for other in (-1, 1):
            there = (touches.position - middle) * [sign, other] >= 0
            if not there.all(axis=1).any():
                ends = ["small" if side < 0 else "large" for side in (sign, other)]
                yield f"no touch lies in the quarter of {ends[0]} {name} and {ends[1]} y"


def _hopeless(table: ResponseTable, touches: LabelledTouches) -> Judgement:
    """The judgement of labels that no skin can have."""
    nothing = np.full((len(touches), table.count), np.nan)
    reach = f"{np.abs(touches.force).max():.3g} N"
    return Judgement(
        stretch=np.inf,
        squared=nothing[:, 0],
        residual=nothing,
        errors=nothing[:, :5],
        suspicion=Suspicion(
            f"forces reach {reach}, where the table knows {table.forces[1]:g} N", np.inf, np.inf
        ),
        warnings=(),
    )
