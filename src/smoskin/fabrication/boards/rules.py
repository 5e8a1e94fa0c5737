"""Published rules of a board house, as numbers and as KiCad's project and rule files.

Decides what a board must keep: every rule is an error, and nothing is excluded. Lengths are
millimetres.
"""

import json
from dataclasses import dataclass, replace
from typing import Any, Final

from smoskin.fabrication.boards.layout import Layout


@dataclass(frozen=True, slots=True, kw_only=True)
class House:
    """What a board house makes; each field is a least length, mm."""

    name: str
    """Board house and process."""
    source: str
    """Page on which it publishes the rules."""
    clearance: float
    track: float
    via: float
    drill: float
    ring: float
    """Copper round a plated hole."""
    hole_to_hole: float
    hole_to_copper: float
    edge: float
    """Copper to the outline."""
    unplated: float
    """Diameter of an unplated hole."""
    text: tuple[float, float]
    """Height and stroke of printed text."""
    mask_bridge: float
    """Web of mask between two openings."""
    largest: tuple[float, float]
    """Most extent of an ordinary order."""


RIGID: Final = House(
    name="JLCPCB, two-sided FR-4, 1 oz copper",
    source="https://jlcpcb.com/capabilities/pcb-capabilities",
    clearance=0.127,
    track=0.127,
    via=0.6,
    drill=0.3,
    ring=0.15,
    hole_to_hole=0.5,
    hole_to_copper=0.33,
    edge=0.3,
    unplated=0.5,
    text=(1.0, 0.15),
    mask_bridge=0.1,
    largest=(400.0, 500.0),
)
"""The house's ordinary process, each number the widest of its page as it has stood over the years
(lines, vias, drills, unplated holes, size, legend) and of rule files that others made from it:
0.33 mm from a plated hole to copper, 0.3 mm to a routed edge. Compare them before an order."""
FLEX: Final = replace(
    RIGID,
    name="JLCPCB, two-sided flexible circuit, 1/3 oz copper",
    source="https://jlcpcb.com/capabilities/flex-pcb-capabilities",
    largest=(230.0, 400.0),
)
"""Stack of 0.11 mm: film of 25 um, copper of 12 um on both faces, cover films of 12.5 um. Its page
could not be compared: the rigid board's rules."""

MASK_MARGIN: Final = 0.05
"""mm: opening of the mask round a land."""
BEND_RATIO: Final = 10
"""Least radius of a bend over the circuit's thickness, for a two-sided circuit that is bent once
(IPC-2223)."""
_TYPES: Final = (
    "annular_width clearance copper_edge_clearance courtyards_overlap "
    "diff_pair_gap_out_of_range diff_pair_uncoupled_length_too_long drill_out_of_range "
    "duplicate_footprints extra_footprint footprint_type_mismatch hole_clearance "
    "hole_near_hole invalid_outline item_on_disabled_layer items_not_allowed "
    "length_out_of_range malformed_courtyard microvia_drill_out_of_range missing_courtyard "
    "missing_footprint net_conflict npth_inside_courtyard padstack pth_inside_courtyard "
    "shorting_items silk_over_copper silk_overlap skew_out_of_range "
    "through_hole_pad_without_hole too_many_vias track_dangling track_width tracks_crossing "
    "unconnected_items unresolved_variable via_dangling zone_has_empty_net zones_intersect "
)
"""Every kind of violation that KiCad knows."""


def house_of(layout: Layout) -> House:
    """Rules of the process that a board is made in."""
    return FLEX if layout.flexible else RIGID


def project_file(layout: Layout) -> str:
    """The KiCad project (``.kicad_pro``) with a house's rules, all severities errors."""
    house = house_of(layout)
    design: dict[str, Any] = {
        "defaults": {"board_outline_line_width": 0.05},
        "drc_exclusions": [],
        "meta": {"filename": "board_design_settings.json", "version": 2},
        "rule_severities": dict.fromkeys(_TYPES.split(), "error"),
        "rules": {
            "allow_blind_buried_vias": False,
            "allow_microvias": False,
            "max_error": 0.005,
            "min_clearance": house.clearance,
            "min_copper_edge_clearance": house.edge,
            "min_hole_clearance": house.hole_to_copper,
            "min_hole_to_hole": house.hole_to_hole,
            "min_microvia_diameter": house.via,
            "min_microvia_drill": house.drill,
            "min_silk_clearance": 0.15,
            "min_through_hole_diameter": house.drill,
            "min_track_width": house.track,
            "min_via_annular_width": house.ring,
            "min_via_diameter": house.via,
            "solder_mask_clearance": MASK_MARGIN,
            "solder_mask_min_width": house.mask_bridge,
        },
        "track_widths": [0.0, 0.2, 0.3, 0.4],
        "via_dimensions": [{"diameter": 0.0, "drill": 0.0}],
    }
    project = {
        "board": {"design_settings": design},
        "boards": [],
        "meta": {"filename": f"{layout.name}.kicad_pro", "version": 1},
        "net_settings": {
            "classes": [_net_class(house)],
            "meta": {"version": 2},
            "net_colors": None,
        },
        "text_variables": {"BOARD_HOUSE": house.name, "BOARD_RULES": house.source},
    }
    return json.dumps(project, indent=2, sort_keys=True) + "\n"


def _net_class(house: House) -> dict[str, Any]:
    """The class of all nets, with every field that KiCad wants."""
    return {
        "clearance": house.clearance,
        "name": "Default",
        "track_width": 0.2,
        "via_diameter": house.via,
        "via_drill": house.drill,
        "microvia_diameter": house.via,
        "microvia_drill": house.drill,
        "diff_pair_gap": 0.25,
        "diff_pair_via_gap": 0.25,
        "diff_pair_width": 0.2,
        "bus_width": 12.0,
        "wire_width": 6.0,
        "line_style": 0,
        "pcb_color": "rgba(0, 0, 0, 0.000)",
        "schematic_color": "rgba(0, 0, 0, 0.000)",
    }


def rule_file(layout: Layout) -> str:
    """Rules beyond KiCad's general ones (``.kicad_dru``)."""
    house = house_of(layout)
    return (
        f"(version 1)\n# {house.name}\n# {house.source}\n"
        f'(rule "unplated holes"\n  (constraint hole_size (min {house.unplated}mm))\n'
        "  (condition \"A.Pad_Type == 'NPTH, mechanical'\"))\n"
        '(rule "drills"\n  (constraint hole_size (max 6.3mm)))\n'
    )
