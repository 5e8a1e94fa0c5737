"""The steps in which a skin is built, with this design's numbers, checks and pictures."""

from dataclasses import dataclass

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.fabrication.drawing import Drawing
from smoskin.fabrication.layout import column_places, magnet_height
from smoskin.fabrication.moulds.assembly import base_inner_radii, pillar_height
from smoskin.fabrication.moulds.covers import PLAY, STROKE, bush_length
from smoskin.fabrication.moulds.creasing import FOLD_STAGES
from smoskin.fabrication.moulds.files import Solids
from smoskin.fabrication.moulds.roll import developed
from smoskin.fabrication.moulds.sheet import cast_height
from smoskin.fabrication.moulds.solids import Part
from smoskin.fabrication.pattern.flat import FlatSheet
from smoskin.fabrication.process import pictures
from smoskin.fabrication.process.pictures import Picture
from smoskin.fabrication.workshop import MAGNET_TEMPERATURE, PRESS_TEMPERATURE, Workshop
from smoskin.origami.cell import dihedral_angles
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import board_box, circuit_thickness, level_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One step: what to do, what to check before going on, and a picture."""

    figure: str
    """Panel of SI Figure S4 that it is, or empty."""
    title: str
    actions: tuple[str, ...]
    checks: tuple[str, ...]
    picture: Picture | None = None


def steps_of(
    design: SkinDesign,
    workshop: Workshop,
    sheet: FlatSheet,
    drawings: list[Drawing],
    solids: Solids,
    parts: list[Part],
) -> tuple[Step, ...]:
    """Every step in the order of work; pictures of a limb's skin lie flat, but for the last."""
    plain = [developed(design, part) for part in parts]
    return (
        _cut(design, workshop, sheet, drawings[0]),
        _bond(design, workshop, sheet),
        _fold(design, sheet, solids),
        _magnets(design),
        _columns(design, workshop, solids),
        _base(design, workshop, plain),
        _stand(design, plain),
        _drip(design, workshop, plain),
        _top(design, workshop, parts),
    )


def _cut(design: SkinDesign, workshop: Workshop, sheet: FlatSheet, upper: Drawing) -> Step:
    """Cutting panels and film."""
    plate = 1e3 * design.panels.thickness / 2
    laminate = f"Cut {design.panels.material} of {plate:g} mm without adhesive."
    if workshop.bond == "adhesive":
        laminate = (
            f"Laminate {1e3 * workshop.adhesive:g} mm double-sided adhesive on one face of the "
            f"{plate:g} mm {design.panels.material}, liner outward, before cutting: adhesive left "
            "in the gaps would make creases several times as stiff, and sticky."
        )
    return Step(
        figure="(1,1)",
        title="Cut panels and film",
        actions=(
            "Cut coupon.dxf; measure the 100 mm bar and the comb; enter the kerf "
            f"(kerf_mm, now {1e3 * workshop.kerf:g}) and make the files again if it differs.",
            laminate,
            "Cut upper.dxf and lower.dxf, each with its outer face up; the lower one is drawn "
            "mirrored. Panels stay in their carriers on bridges of "
            f"{1e3 * workshop.bridge:g} mm.",
            f"Cut film.dxf: outline, four pin holes and {len(sheet.inner)} vertex holes. "
            "MOUNTAIN and VALLEY are not cut.",
        ),
        checks=(
            "bar 100.0 ± 0.1 mm; gaps of the coupon's tiles as engraved, ± 0.1 mm",
            "no panel has fallen out of its carrier",
        ),
        picture=pictures.drawn(upper, "Upper panels in their carrier (upper.dxf)"),
    )


def _bond(design: SkinDesign, workshop: Workshop, sheet: FlatSheet) -> Step:
    """Bonding panels to the film."""
    plate = 1e3 * design.panels.thickness / 2
    bond = (
        "Put the lower panels on the pins, liner off; lower the film on to them from one edge; "
        "then the upper panels. Press with a roller, one hour under 10 kg."
    )
    if workshop.bond == "hot press":
        bond = (
            f"Stack lower panels, film and upper panels on steel pins between two plates; press at "
            f"{PRESS_TEMPERATURE:.0f} degC. Never with acrylic: it decomposes from 220 degC to "
            "flammable vapour. The SI names neither pressure nor time."
        )
    return Step(
        figure="(1,2)",
        title="Bond panels to the film and free them",
        actions=(
            f"Put pins of {1e3 * workshop.pin:g} mm into laminating_plate; one stands aside, "
            "so that the sheets fit one way.",
            bond,
            "Cut the bridges by upper_release.dxf and, turned over, lower_release.dxf, only as "
            f"deep as the panels ({plate:g} mm); try on the coupon first. Blow out what lies "
            "loose in the gaps, and trim the film along TRIM.",
        ),
        checks=(
            "film unhurt in every gap, against the light",
            f"gaps of b-creases {1e3 * sheet.at_b.convex:.2f} and "
            f"{1e3 * sheet.at_b.concave:.2f} mm, on opposite faces",
        ),
        picture=pictures.layers_of_a_crease(design, sheet, workshop),
    )


def _fold(design: SkinDesign, sheet: FlatSheet, solids: Solids) -> Step:
    """Folding in stages."""
    fold_a, fold_b = (180 - float(np.degrees(a)) for a in dihedral_angles(design.cell))
    [die] = [part for part in solids.tools if part.name == f"crease_die_{len(FOLD_STAGES)}"]
    heights = ", ".join(f"{share:.0%}" for share in FOLD_STAGES)
    rows = (
        (
            "The sheet curls as it folds: where a mould takes fewer rows of cells than the sheet "
            "has, begin in the middle and move on by a row at a time.",
        )
        if design.limb
        else ()
    )
    return Step(
        figure="(1,3)",
        title="Fold in stages",
        actions=(
            f"Crease between crease_die and crease_punch, stages 1 to {len(FOLD_STAGES)} "
            f"({heights} of the height). Let the sheet draw in between stages: it is "
            f"{1e3 * float(sheet.extent[0] - geometry(design).extent[0]):.0f} mm shorter and "
            f"{_draws_in_y(design, sheet):.0f} mm narrower when it is folded, and one stroke "
            "would tear it.",
            *rows,
            "Hold the last stage an hour; warm to 60 degC if the film springs back, not more "
            "with acrylic.",
        ),
        checks=(
            f"taken out, a-creases keep {fold_a:.0f} deg and b-creases {fold_b:.0f} deg times "
            f"the set that the design counts on, {design.creases.set_fraction:.0%}; less, and "
            "rim columns lean outward",
            "no panel touches its neighbour",
        ),
        picture=pictures.section(
            [die], _middle_x(die), "Die of the last stage, cut across", across_y=False
        ),
    )


def _draws_in_y(design: SkinDesign, sheet: FlatSheet) -> float:
    """How much narrower the folded sheet is along y, mm."""
    y = geometry(design).developed[:, 1]
    return 1e3 * float(sheet.extent[1] - np.ptp(y))


def _middle_x(part: Part) -> float:
    """A place near the middle of a part along x, off its vertices."""
    low, _, _, high, _, _ = part.solid.bounding_box()
    return float(low + 0.4771 * (high - low))


def _magnets(design: SkinDesign) -> Step:
    """Casting and magnetising sectors."""
    magnets = design.magnets
    return Step(
        figure="(2,1) to (2,3)",
        title="Cast, cure and magnetise the sectors",
        actions=(
            "Fill magnet_mould between aluminium plates, scraped off flush; mould of "
            "aluminium, PTFE or PEEK, never PLA, which softens at 60 degC; parting agent.",
            f"Cure 1 h at {MAGNET_TEMPERATURE:.0f} degC; push the sectors out.",
            "Magnetise each sector in coil_jig (no metal), its notch along the coil's field: "
            "bonded NdFeB needs 2 to 3 T to saturate.",
            "Put four sectors into each holder, like poles to the middle: they push each other "
            "apart; glue the lid on at once. Mark the holders: "
            + ", ".join(m.name for m in magnets)
            + ".",
        ),
        checks=(
            "one magnet over one chip at its gap, before the rest is built: bonded magnets "
            "have 0.4 to 1.0 T; gaps (shims) and gain by the reading: table of magnets, or "
            "smoskin new-design --remanence",
            "sectors' height within 0.1 mm",
        ),
        picture=pictures.sectors(design),
    )


def _columns(design: SkinDesign, workshop: Workshop, solids: Solids) -> Step:
    """Casting columns."""
    plate = next(part for part in solids.tools if part.name == "column_plate")
    return Step(
        figure="(3,1), (3,2)",
        title="Cast the columns",
        actions=(
            "Mould: column_plate on column_floor, printed by FDM or machined; no SLA resin, "
            "sulphur or latex near platinum silicone, it would not cure.",
            f"Mix {design.columns.material}, degas, fill by syringe, scrape off flush "
            f"({1e3 * cast_height(design, workshop):.1f} mm high: the missing "
            f"{1e3 * workshop.drip:g} mm are dripped on later). Cure 4 h at 23 degC.",
            "Push the columns out with column_ejector. They have no taper: one degree would "
            "cost a fifth of their lateral stiffness.",
        ),
        checks=(
            f"{len(column_places(design))} columns without bubbles, "
            f"{2e3 * design.columns.radius:.2f} ± 0.2 mm in diameter",
        ),
        picture=pictures.plan([plate], float(plate.size[2]) / 2, "Mould of the columns"),
    )


def _level(design: SkinDesign) -> float:
    """A height that cuts the magnets on the sheet, and the frame where it stands as high, m."""
    heights = [
        (magnet_height(design, magnet), magnet.height)
        for magnet in design.magnets
        if magnet.mount == "sheet"
    ]
    middle, height = heights[0] if heights else (-design.columns.height / 2, 0.0)
    frame = design.frame.held_height - design.columns.height
    return min(middle, max(frame - 1e-4, middle - 0.45 * height))


def _of(parts: list[Part], *kinds: str) -> list[Part]:
    """Parts of some kinds."""
    return [part for part in parts if part.name.split("_")[0] in kinds]


def _base(design: SkinDesign, workshop: Workshop, parts: list[Part]) -> Step:
    """Base, shear layer and board."""
    base_magnets = [m.name for m in design.magnets if m.mount == "base"]
    pillars = _of(parts, "base", "pillar", "plug")
    under = -design.columns.height - design.board.thickness - design.shear_layer.height / 2
    return Step(
        figure="(5), (6)",
        title="Base, shear layer and board",
        actions=(
            f"Put {', '.join(base_magnets) or 'no magnet'} into the pocket of the base, shims "
            "as measured, plug on top.",
            *_carrier(design, workshop),
            f"Cast {design.shear_layer.pillars} pillars of {design.shear_layer.material} in "
            f"pillar_mould ({2e3 * design.shear_layer.radius:g} mm wide, "
            f"{1e3 * pillar_height(design):.3g} mm high) and bond them to primed base and board, "
            f"{1e3 * design.shear_layer.height:g} mm apart.",
            "Lead the board's cable to the base in a slack loop: it must not add more than 5 % "
            "to the shear layer's stiffness. No nickel, steel or connector within 10 mm of a "
            "chip; base screws of nylon or brass.",
        ),
        checks=("every chip answers at its address", "the board comes back from 0.3 mm aside"),
        picture=pictures.over(
            pictures.plan(pillars, under, "Pillars on the base with the board's outline"),
            geometry(design).roll.from_flat(board_box(design).corners, level_of(design)),
        ),
    )


def _carrier(design: SkinDesign, workshop: Workshop) -> list[str]:
    """What a limb's skin takes besides: a circuit laid on its shell."""
    if design.limb is None:
        return []
    lower = [site.name for site in design.halls if design.magnet(site.magnet).mount == "base"]
    near, far = (f"{1e3 * radius:.1f} mm" for radius in base_inner_radii(design, workshop))
    radius = f"a radius of {near}" if near == far else f"radii from {near} to {far}"
    return [
        f"Lay the flexible circuit, {1e3 * circuit_thickness(design):g} mm, on the shell on a "
        f"film of adhesive, from the middle outward: {', '.join(lower) or 'no chip'} with its "
        "capacitors in the window, stiffeners of the upper chips in the flat pockets; its lengths "
        "are true on the shell, not on the skin.",
        f"The limb under the base has {radius}.",
    ]


def _stand(design: SkinDesign, parts: list[Part]) -> Step:
    """Columns, frame and holders."""
    sheet_magnets = [m.name for m in design.magnets if m.mount == "sheet"]
    level, stand = _level(design), _of(parts, "column", "holder", "magnet", "frame")
    strips = ", a strip for each row of columns," if design.limb else ""
    drivers = [
        f"Glue a rubber column of {1e3 * part.size[0]:.1f} mm, {1e3 * part.size[2]:.1f} mm high, "
        f"on {part.name.replace('driver', 'lid')}; drip it to the sheet with the others."
        for part in _of(parts, "holder")
        if "driver" in part.name
    ]
    return Step(
        figure="(4)",
        title="Columns, frame and holders",
        actions=(
            f"Glue the frame on to the board; lay foot_jig{strips} into it; prime the board's "
            "mask; set a column into each hole on a drop of rubber; lift the jig off when it "
            "has cured.",
            f"Thread the holders {', '.join(sheet_magnets)} from above between their columns; "
            "put a feeler of the gap between holder and chip, and fill the notches' play with "
            "a bead of rubber each, which carries the holder and lets it turn.",
            *drivers,
        ),
        checks=(
            "holders hang free of board and frame",
            *(
                f"{site.name}: gap {1e3 * site.gap:g} mm from magnet to sensing point, "
                f"{1e3 * (site.gap + design.board.sensing_height):.1f} mm to the board"
                for site in design.halls
                if design.magnet(site.magnet).mount == "sheet"
            ),
        ),
        picture=pictures.plan(stand, level, "Columns, holders and frame, cut at the magnets"),
    )


def _drip(design: SkinDesign, workshop: Workshop, parts: list[Part]) -> Step:
    """The sheet on its columns."""
    halves = ", its halves taped together," if design.limb else ""
    lift = "slide its halves round the limb until they clear the sheet" if halves else "lift it off"
    return Step(
        figure="(4)",
        title="Sheet on to the columns",
        actions=(
            f"Set fold_jig{halves} on the frame's wall and the folded sheet into it, bottom "
            "vertices over their columns.",
            f"Drip {design.columns.material} on to every bottom vertex, "
            f"{1e9 * np.pi * design.columns.radius**2 * workshop.drip:.0f} mm3 each: it does "
            "not bond to acrylic or polyimide and must run through the vertex hole and lock "
            f"behind it, or the faces are primed. Cure 4 h; then the jig: {lift}.",
        ),
        checks=(
            "every column pulls its vertex; none is aside by more than 0.3 mm",
            f"rim columns stand {1e3 * design.frame.clearance:.1f} ± 0.1 mm from the frame",
        ),
        picture=pictures.through_a_magnet(design, parts),
    )


def _top(design: SkinDesign, workshop: Workshop, parts: list[Part]) -> Step:
    """Top scales, or the covers in their place."""
    across = design.limb is not None or workshop.top == "covers"
    if across:
        at, caption = pictures.across_a_magnet(design), "The finished skin, cut across its rows"
        picture = pictures.section(parts, at, caption, across_y=False)
    else:
        top = _of(parts, "scale")
        height = float(np.array(top[0].solid.bounding_box())[5]) - workshop.scale_pad / 2
        picture = pictures.plan(top, height, "Scales, one a cell")
    wet = (
        "For wet use coat with parylene last, the connector masked; it bridges creases and "
        "stiffens rubber: calibrate after it, not before."
    )
    if workshop.top == "covers":
        return _covers(design, workshop, wet, picture)
    widths = " in as many widths as rows of cells along x" if geometry(design).roll.rise else ""
    return Step(
        figure="(7)",
        title="Top scales",
        actions=(
            f"Cast scales in scale_mould{widths}, bond each by its patch alone to its top vertex. "
            "The paper prints neither their size nor the patch's: both are this package's choice.",
            wet,
        ),
        checks=("scales do not touch each other when one is pressed by 2 mm",),
        picture=picture,
    )


def _covers(design: SkinDesign, workshop: Workshop, wet: str, picture: Picture) -> Step:
    """The guide and the covers of SI Figure S16."""
    many = design.cells[0] * design.cells[1]
    return Step(
        figure="",
        title="Guide and cover panels, SI Figure S16",
        actions=(
            "Glue the guide's posts on to the frame, its bushes over the top vertices, with two "
            "covers in opposite corners to place it.",
            f"Put a drop of {design.columns.material} on each top vertex, or glue on a primed "
            f"one, and lower {many} covers through their bushes on to it; cure.",
            "The figure has no size: bars, bushes of "
            f"{1e3 * bush_length(design, workshop):.1f} mm, in which a bar does not bind at a "
            f"friction of 0.2, {1e3 * PLAY:g} mm of play and {1e3 * STROKE:g} mm of stroke are "
            "this package's choice.",
            "Read such a skin by the paper's theory (smoskin fit-paper): response tables are of "
            "skins that are touched on their sheet.",
            wet,
        ),
        checks=(
            "every cover comes back by itself, pressed in its middle and on a corner",
            "covers beside a pressed one follow freely, by 0.3 mm at most at 1 N",
        ),
        picture=picture,
    )
