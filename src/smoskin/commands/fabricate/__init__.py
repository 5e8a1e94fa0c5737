"""Makes the files of a skin for workshop and board house, and tells what they are."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.bundle import Bundle, make_bundle, write_bundle
from smoskin.fabrication.workshop import Workshop
from smoskin.outputs import check_output
from smoskin.roles import Progress

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class FabricationReport:
    """What was made, and where it lies."""

    bundle: Bundle
    out: Path
    files: tuple[Path, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        return {
            "design_hash": self.bundle.design.content_hash,
            "folder": str(self.out),
            "files": [str(file) for file in self.files],
            "mass_g": sum(item.mass_g for item in self.bundle.items),
        }

    def tables(self) -> "list[Table]":
        """Files by kind, and the bill of materials."""
        from rich.table import Table

        kinds: dict[str, list[str]] = {}
        for file in self.bundle.files:
            kinds.setdefault(file.kind, []).append(file.path)
        files = Table("kind", "files", "first", title=f"Files in {self.out}")
        for kind, paths in sorted(kinds.items()):
            files.add_row(kind, str(len(paths)), paths[0])
        bill = Table("part", "quantity", "material", "mass, g", title="Bill of materials")
        for item in self.bundle.items:
            bill.add_row(item.part, f"{item.quantity:g}", item.material, f"{item.mass_g:.2f}")
        bill.add_row("total", "", "", f"{sum(item.mass_g for item in self.bundle.items):.1f}")
        return [files, bill]


@typed
def fabricate(
    design: SkinDesign,
    out: Path,
    *,
    workshop: Workshop | None = None,
    step: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> FabricationReport:
    """Write every file from which a design is built into a folder, STEP where it is asked.

    Raises
    ------
    DesignError
        If the design cannot be made in this workshop.
    FileError
        If files exist already and `force` is not given, or cannot be written.
    """
    check_output(out, folder=True)
    check_output(out / "manifest.json", force=force)
    bundle = make_bundle(design, workshop, step=step, progress=progress)
    return FabricationReport(bundle=bundle, out=out, files=write_bundle(bundle, out, force=force))
