"""Writes the tables and the figure of docs/trust.md: what each effect of the hard world costs.

Run ``python docs/make_trust.py`` after changing trust.json; ``python docs/make_trust.py NAME ...``
measures worlds or effects anew first, with `smo.score`, some minutes each (``--skins 31,32
--count 20``), ``NAME@15`` after 15 touches. A test compares page and figures.
"""

import argparse
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from smoskin.commands.score import ScoreSheet

FIGURES = Path(__file__).parent / "trust.json"
PAGE = Path(__file__).parent / "trust.md"
PLOT = Path(__file__).parent / "trust.svg"
TOLD = {
    "plain": "the plain world",
    "stream": "the same, read as a stream",
    "contact": "laws outside the family in turn: smoothstep-half, half-lever, tight, smoothstep",
    "cover": "an elastomer cover by finite elements, drawn for each skin",
    "smoothstep-half": "shares half a smoothstep between vertices",
    "smoothstep": "shares a smoothstep between vertices",
    "tight": "a vertex takes everything on a sixth of its way to the next",
    "half-lever": "half of the lever past the rim",
    "no-lever": "none: the rim is blind",
    "gaussian": "Gaussian shares, 10 mm: the rim is all but blind",
    "fingers": "fingertips of 2 to 8 mm",
    "hysteresis": "loops of 2 to 3 % of each motion",
    "bouc-wen": "the same by another law than the estimator's, Bouc-Wen",
    "debonded": "one column off its base",
    "glue": "magnets, columns and chips placed and glued twice as badly",
    "sectors": "sectors of a magnet that differ by 5 %",
    "earth": "60 uT, turned by a quarter and back in 20 s",
    "motor": "a dipole of 0.06 A m^2 that goes round beside the skin",
    "steel": "a steel ball of 30 mm that passes by",
    "motor-inside": "the same motor 60 mm under the middle of the skin",
    "steel-inside": "the same ball there",
    "gravity": "own weight as the arm turns by a quarter: the board slides by 1.3 mm",
    "warmth": "chips that warm by 1 to 3 K, magnets by half of that",
    "arrival": "readings 5 ms late, 5 % lost",
    "hard without gravity": "all of the hard world but the skin's weight",
    "hard": "the hard world",
    "hard, posed": "the same on an arm that tells its pose (`--posed`)",
    "hard, bouc-wen": "the same with the loops of the row bouc-wen",
    "hard, network": "the same, read by networks trained on each skin's table (`train --arm`)",
}
"""What each row is, in the page's order."""
TOUCHES = (8, 15, 30, 60, 120)
"""Touches of a calibration after which errors are told."""


def rows(figures: dict[str, dict[str, float]]) -> str:
    """The page's table."""
    lines = [
        "| effect | mean error of place | of force | 90 % regions hold | idle | what it is |",
        "|---|---|---|---|---|---|",
    ]
    for name, what in TOLD.items():
        if name in figures:
            scores = figures[name]
            few = (
                ""
                if scores["touches"] >= 1000
                else f" ({scores['touches']:.0f} touches on {scores['skins']:.0f} skins)"
            )
            lines.append(
                f"| {name} | {scores['location_mm']:.2f} mm | {scores['force_percent']:.1f} % | "
                f"{scores['held_percent']:.0f} % | {scores['idle_percent']:.0f} % | {what}{few} |"
            )
    return "\n".join(lines)


def by_touches(figures: dict[str, dict[str, float]]) -> str:
    """The page's table of errors after few touches and many."""
    lines = [
        "| touches | hard world | regions hold | plain world | regions hold |",
        "|" + 5 * "---|",
    ]
    for touches in TOUCHES:
        both = [figures[f"{name}@{touches}"] for name in ("hard", "plain")]
        cells = [
            f"{world['location_mm']:.2f} mm, {world['force_percent']:.1f} % "
            f"| {world['held_percent']:.0f} %"
            for world in both
        ]
        lines.append(f"| {touches} | {' | '.join(cells)} |")
    return "\n".join(lines)


def page(text: str, figures: dict[str, dict[str, float]]) -> str:
    """The page with these figures."""
    for name, table in (("rows", rows(figures)), ("touches", by_touches(figures))):
        marks = f"<!-- {name} -->", f"<!-- end of {name} -->"
        made = f"{marks[0]}\n\n{table}\n\n{marks[1]}"
        text = re.sub(f"{marks[0]}.*{marks[1]}", lambda _, made=made: made, text, flags=re.S)
    return text


def networks(skins: list[int], count: int) -> dict[str, float]:
    """Figures of networks in the hard world, each trained on the table of one skin there."""
    import numpy as np

    import smoskin as smo
    from smoskin.commands.score import Exam, candidate
    from smoskin.twin.world.worlds import HARD

    design, table = smo.load_design("planar"), smo.load_response_table("planar")
    subject = candidate(table, design, Exam(world=HARD))
    each = []
    for skin in skins:
        rng = np.random.default_rng([skin, 0])
        own, _ = subject.enter(HARD.skin(design, skin, None), rng, HARD)
        assert own is not None
        network = smo.train(own, arm=True).model
        each.append(figures_of(smo.score(network, skins=[skin], count=count), [skin], count))
    mean = {name: round(float(np.mean([scores[name] for scores in each])), 3) for name in each[0]}
    return mean | {"skins": len(skins), "touches": 10 * count * len(skins)}


def measure(name: str, skins: list[int], count: int) -> dict[str, float]:
    """Figures of the shipped table in a world, or in that of one effect."""
    import smoskin as smo
    from smoskin.twin.world.effect import World
    from smoskin.twin.world.worlds import EFFECTS, HARD, PLAIN, world_of

    if name == "hard, network":
        return networks(skins, count)
    name, _, touches = name.partition("@")
    worlds = {base.name: base for base in (PLAIN, HARD)}
    if name == "hard without gravity":
        few = tuple(effect for effect in HARD.effects if effect != EFFECTS["gravity"])
        worlds[name] = World(name=name, effects=few)
    if name == "hard, bouc-wen":
        swap = {EFFECTS["hysteresis"]: EFFECTS["bouc-wen"]}
        worlds[name] = World(
            name=name, effects=tuple(swap.get(effect, effect) for effect in HARD.effects)
        )
    name, posed, _ = name.partition(", posed")
    world = worlds.get(name) or world_of(effect=name)
    table = smo.load_response_table("planar")
    judged = smo.score(
        table,
        skins=skins,
        count=count,
        world=world,
        touches=int(touches or 60),
        posed=bool(posed),
    )
    return figures_of(judged, skins, count)


def figures_of(judged: "ScoreSheet", skins: list[int], count: int) -> dict[str, float]:
    """What the page says of a score."""
    case = judged.case("straight")
    assert case is not None
    chief = case.headline
    return {
        "skins": len(skins),
        "touches": 10 * count * len(skins),
        "location_mm": round(1e3 * chief.location.mean, 3),
        "force_percent": round(100 * chief.force, 2),
        "held_percent": round(100 * chief.held.place, 1),
        "idle_percent": round(100 * case.idle.right, 1),
        "found_percent": round(100 * chief.detected, 1),
    }


def draw(figures: dict[str, dict[str, float]]) -> None:
    """A bar for each effect, on a logarithmic scale."""
    from matplotlib.figure import Figure

    from smoskin.plots import BLUE, ORANGE, Plate, styled

    names = [name for name in TOLD if name in figures][::-1]
    means = [figures[name]["location_mm"] for name in names]
    with styled():
        figure = Figure(figsize=(6.4, 0.22 * len(names) + 0.8), layout="constrained")
        axes = figure.subplots()
        plain = figures["plain"]["location_mm"]
        colours = [BLUE if mean < 2 * plain else ORANGE for mean in means]
        axes.barh(names, means, color=colours)
        axes.axvline(plain, color="black", linewidth=0.6)
        axes.set(xscale="log", xlabel="mean error of place (mm)", xlim=(0.1, 100))
    Plate(name=PLOT.stem, title="What each effect costs", caption="", figure=figure).write(
        PLOT.parent
    )


def main() -> None:
    """Measure what is asked for, then write page and figure."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("names", nargs="*", metavar="NAME", help=", ".join(TOLD))
    asked.add_argument("--skins", default="31,32", help="seeds of the made skins")
    asked.add_argument("--count", type=int, default=20, help="places for each of ten forces")
    given = asked.parse_args()
    figures = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
    for name in given.names:
        figures[name] = measure(name, [int(seed) for seed in given.skins.split(",")], given.count)
        print(name, figures[name], flush=True)
        FIGURES.write_text(json.dumps(figures, indent=1) + "\n")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), figures), encoding="utf-8")
    draw(figures)


if __name__ == "__main__":
    main()
