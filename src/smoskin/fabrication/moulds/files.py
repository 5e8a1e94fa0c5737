"""Files of the solid parts: an STL each, split for the printer's bed, and 3MF files of all."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from smoskin.design.skin import SkinDesign
from smoskin.fabrication.artifact import Artifact
from smoskin.fabrication.layout import columns_developed
from smoskin.fabrication.moulds import assembly
from smoskin.fabrication.moulds.holders import holders
from smoskin.fabrication.moulds.solids import Part, laid, stl, three_mf
from smoskin.fabrication.moulds.split import split
from smoskin.fabrication.moulds.step import step
from smoskin.fabrication.moulds.tools import tools
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solids:
    """What is printed or machined for a skin."""

    parts: tuple[Part, ...]
    """Parts that stay in the skin, as they are printed."""
    tools: tuple[Part, ...]
    """Moulds and jigs, before they are split."""
    files: tuple[Artifact, ...]


def solid_files(design: SkinDesign, workshop: Workshop) -> Solids:
    """Every printed part and tool of a design, and its files.

    Raises
    ------
    DesignError
        If a part would be thinner than the printer makes, or larger.
    MissingExtraError
        If the solid modeller is not installed.
    """
    sheet = flat_sheet(design, workshop)
    parts = printed_parts(design, workshop)
    made = tools(design, workshop, sheet)
    feet, files = columns_developed(design), []
    kept = {"column": feet, "foot": feet, "guide": geometry(design).tops.reshape(-1, 2)}
    for folder, solids in (("parts", parts), ("moulds", made)):
        pieces = []
        for part in solids:
            pieces += split(part, workshop.bed, kept.get(part.name.split("_")[0]))
        files += _written(folder, pieces)
        title = f"{design.name} {design.content_hash[:12]}: {folder}"
        content = three_mf(pieces, title)
        path = f"{folder}/{folder}.3mf"
        files.append(Artifact(path=path, kind="3mf", units="mm", content=content))
    return Solids(parts=tuple(parts), tools=tuple(made), files=tuple(files))


def printed_parts(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """Parts that stay in the skin, each on z = 0."""
    parts = [
        assembly.frame(design),
        *(part for part in assembly.board(design, workshop) if part.name == "shell"),
        *holders(design, workshop),
        *assembly.base(design, workshop),
    ]
    if workshop.top == "covers":
        guide, *covers = assembly.top(design, workshop)
        parts += [guide, replace(covers[0], name="cover", quantity=len(covers))]
    # Rubber columns on holders are cast, or cut from a rod.
    return [
        laid(part, upside_down=part.name == "cover")
        for part in parts
        if not part.name.startswith("holder_driver")
    ]


def step_file(design: SkinDesign, workshop: Workshop) -> Artifact:
    """The assembled skin with its panels, a STEP file."""
    parts = assembly.whole_skin(design, flat_sheet(design, workshop), workshop)
    content = step(parts, f"{design.name} {design.content_hash[:12]}")
    return Artifact(path="assembly.step", kind="step", units="mm", content=content)


def _written(folder: str, pieces: Sequence[Part]) -> list[Artifact]:
    """An STL file a piece."""
    return [
        Artifact(path=f"{folder}/{part.name}.stl", kind="stl", units="mm", content=stl(part))
        for part in pieces
    ]
