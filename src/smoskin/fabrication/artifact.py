"""One file of a bundle: what it is, in which unit, and its content."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "dxf",
    "svg",
    "fold",
    "pdf",
    "stl",
    "3mf",
    "step",
    "kicad_pcb",
    "kicad_sch",
    "kicad_pro",
    "csv",
    "html",
    "json",
    "gerber",
    "drill",
    "text",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Artifact:
    """A file to be written."""

    path: str
    """Place in the bundle, with forward slashes."""
    kind: Kind
    units: str
    """Unit of its lengths, such as ``mm``; empty where it has none."""
    content: bytes
