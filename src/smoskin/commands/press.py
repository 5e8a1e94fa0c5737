"""A campaign of touches by a rig: gone on with after any stop, with a picture of how far it is.

Decides what stands in the recording before the first press: the plan, its SHA-256, and which of
its touches are held out.
"""

import hashlib
import time
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.hardware.rig.plans import held_out
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.outputs import write_output
from smoskin.records import Contact, HeldTouch
from smoskin.roles import Progress, Rig
from smoskin.service.campaign import press_plan
from smoskin.service.kept import Campaign

_EVERY: Final = 5.0
"""Seconds after which the picture is drawn anew."""
_WIDE, _HEAD, _RIM = 480.0, 76.0, 24.0
"""Sizes of the picture: what is pressed, the words over it, what is round it."""
_FAR: Final = 20e-3
"""Force by which a press is off that is drawn in full red, N."""


def press(
    rig: Rig,
    design: SkinDesign,
    plan: Path,
    out: Path,
    known: dict[str, Any],
    *,
    share: float,
    picture: Path | None,
    progress: Progress,
) -> int:
    """Make what is missing of a plan's touches in a sheet or a recording; how many it has then.

    `known` is kept in a recording, with which touches are held out, such a share of the places.
    """
    wanted, held = read_touches(plan)[0], held_out(read_touches(plan)[0], share)
    made: TouchTable | None = None
    if out.suffix != ".mcap":
        if share:
            raise ArgumentError("out must be a recording (.mcap), which keeps what is held out")
        made = read_touches(out)[0] if out.exists() else None
        drawn = _Picture(picture, wanted, made, held)
        keep = partial(write_touches, out)
        done = press_plan(rig, wanted, made=made, keep=keep, on_touch=drawn.add, progress=progress)
        return len(done.contacts)
    whole = plan.read_bytes()
    known |= {"place_spread": rig.place_spread, "force_spread": rig.force_spread}
    known |= {"plan_sha256": hashlib.sha256(whole).hexdigest(), "held_out": held}
    with Campaign(out, design, plan=whole, rig=known) as campaign:
        made = campaign.made
        drawn = _Picture(picture, wanted, made, held)

        def keep_touch(touch: HeldTouch) -> None:
            campaign.add(touch)
            drawn.add(touch)

        press_plan(rig, wanted, made=made, on_touch=keep_touch, progress=progress)
        return len(campaign.touches)


def real_rig(source: str, stage: str, gauge: str, **options: Any) -> Rig:
    """A rig of these parts, all open or none."""
    from smoskin.hardware.rig.gauge import open_gauge
    from smoskin.hardware.rig.press import PressRig
    from smoskin.hardware.rig.stage import open_stage
    from smoskin.service.source import open_source

    with ExitStack() as parts:
        carrier = parts.enter_context(open_stage(stage))
        feeler = parts.enter_context(open_gauge(gauge))
        rig = PressRig(parts.enter_context(open_source(source)), carrier, feeler, **options)
        parts.pop_all()
        return rig


class _Picture:
    """A campaign as an SVG file, anew after every few seconds and at the end; none without a path.

    It shows which places have been pressed, which are held out, how far forces and places are off
    what was asked, and what the touch that is made again and again has come to.
    """

    def __init__(
        self, path: Path | None, plan: TouchTable, made: TouchTable | None, held: Sequence[int]
    ) -> None:
        self._path, self._targets = path, plan.contacts
        self._made: list[Contact] = [] if made is None else list(made.contacts)
        self._before, self._begun, self._drawn = len(self._made), time.monotonic(), -np.inf
        self._held = frozenset(held)
        self._sizes: list[float] = []

    def add(self, touch: HeldTouch) -> None:
        """Take a touch that was made."""
        target = self._targets[len(self._made)]
        if target == self._targets[0]:
            self._sizes.append(_signal(touch))
        self._made.append(touch.contact)
        now, done = time.monotonic(), len(self._made) == len(self._targets)
        if self._path is not None and (done or now - self._drawn > _EVERY):
            self._drawn = now
            write_output(self._path, self._svg().encode())

    def _svg(self) -> str:
        """The picture."""
        at = np.array([target.position for target in self._targets])
        low, size = at.min(axis=0), max(float(np.ptp(at, axis=0).max()), 1e-6)
        pixels = _RIM + _WIDE * (at - low) / size
        high = float(pixels[:, 1].max()) + _RIM + _HEAD
        places: dict[tuple[float, float], list[int]] = {}
        for number, (x, y) in enumerate(pixels.tolist()):
            places.setdefault((x, y), []).append(number)
        radius = min(10.0, 0.4 * _WIDE / max(len(places) ** 0.5, 1.0))
        dots = []
        for (x, y), numbers in places.items():
            pressed = [number for number in numbers if number < len(self._made)]
            off = max((abs(self._off(number)) for number in pressed), default=0.0)
            red = min(off / _FAR, 1.0)
            fill = f"rgb({60 + 160 * red:.0f},{150 - 100 * red:.0f},90)"
            ring = "#2255cc" if numbers[0] in self._held else "#bbbbbb"
            dots.append(
                f'<circle cx="{x:.1f}" cy="{high - y:.1f}" r="{radius:.1f}" fill="{fill}" '
                f'fill-opacity="{len(pressed) / len(numbers):.2f}" stroke="{ring}"/>'
            )
        words = "".join(
            f'<text x="{_RIM:g}" y="{20 + 18 * k}">{line}</text>'
            for k, line in enumerate(self._words())
        )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDE + 2 * _RIM:g}" '
            f'height="{high:.0f}" font-family="sans-serif" font-size="13">\n'
            f"{words}\n{''.join(dots)}\n</svg>\n"
        )

    def _words(self) -> list[str]:
        """What is said over the picture."""
        made, all_ = len(self._made), len(self._targets)
        pace = (time.monotonic() - self._begun) / max(made - self._before, 1)
        lines = [f"{made} of {all_} touches; {(all_ - made) * pace / 60:.0f} min to go"]
        off = [self._off(number) for number in range(made)]
        away = [
            np.linalg.norm(contact.position - target.position)
            for contact, target in zip(self._made, self._targets, strict=False)
        ]
        lines.append(
            f"off what was asked: {1e3 * np.mean(np.abs(off)):.1f} mN (at most "
            f"{1e3 * np.max(np.abs(off)):.0f}), {1e3 * np.mean(away):.3f} mm"
        )
        if len(self._sizes) > 1 and self._sizes[0] > 0.0:
            change = 100.0 * (self._sizes[-1] / self._sizes[0] - 1.0)
            lines.append(
                f"the first touch, made {len(self._sizes)} times: {change:+.1f} % a newton"
            )
        return lines

    def _off(self, number: int) -> float:
        """How much harder a touch was than asked, N."""
        return self._made[number].normal_force - self._targets[number].normal_force


def _signal(touch: HeldTouch) -> float:
    """Length of the change of all fields by a touch, a newton, T/N; 0 if it was not read."""
    means = []
    for begin, end in (touch.rest, touch.held):
        fields = [reading.field for reading in touch.readings if begin <= reading.time <= end]
        good = [field for field in fields if np.isfinite(field).all()]
        if not good:
            return 0.0
        means.append(np.mean(good, axis=0))
    return float(np.linalg.norm(means[1] - means[0]) / max(touch.contact.normal_force, 1e-3))
