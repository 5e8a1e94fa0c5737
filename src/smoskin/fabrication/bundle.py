"""The whole bundle of a design: every file, and the manifest that names them.

Decides what a bundle holds and that the same design gives the same bytes.
"""

import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Final

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import require
from smoskin.fabrication.artifact import Artifact
from smoskin.fabrication.boards.files import board_files
from smoskin.fabrication.materials import Item, bill, bill_csv
from smoskin.fabrication.moulds.files import solid_files, step_file
from smoskin.fabrication.pattern.files import pattern_files
from smoskin.fabrication.process.files import process_files
from smoskin.fabrication.workshop import Workshop, check_process
from smoskin.outputs import check_output, read_text, write_output
from smoskin.roles import Progress

MANIFEST: Final = "manifest.json"
"""Name of the file that lists the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """Files of a skin."""

    design: SkinDesign
    files: tuple[Artifact, ...]
    """Every file but the manifest."""
    items: tuple[Item, ...]
    """Bill of materials."""

    @property
    def manifest(self) -> bytes:
        """The list of files with their checksums, JSON."""
        listed = [
            {
                "path": file.path,
                "kind": file.kind,
                "sha256": hashlib.sha256(file.content).hexdigest(),
                "units": file.units,
            }
            for file in self.files
        ]
        document = {
            "design_hash": self.design.content_hash,
            "version": version("smoskin"),
            "files": listed,
        }
        return (json.dumps(document, indent=1) + "\n").encode()


@typed
def make_bundle(
    design: SkinDesign,
    workshop: Workshop | None = None,
    *,
    step: bool = False,
    progress: Progress | None = None,
) -> Bundle:
    """Every file from which a workshop and a board house build a design, STEP where it is asked.

    Raises
    ------
    DesignError
        If the design cannot be made in this workshop; the message has the measure and the limit.
    MissingExtraError
        If the extra ``fabrication`` is not installed, or ``step`` where it is needed.
    """
    require("making a skin's files", "fabrication", "ezdxf", "shapely", "manifold3d")
    if step:
        require("writing STEP files", "step", "OCP")
    shop = workshop or Workshop()
    check_process(design, shop)
    tell = progress or (lambda what, share: None)
    tell("patterns", 0.1)
    files = pattern_files(design, shop)
    tell("moulds and parts", 0.4)
    solids = solid_files(design, shop)
    files += solids.files
    tell("boards", 0.8)
    files += board_files(design)
    tell("bill of materials", 0.9)
    items = bill(design, shop, solids.parts)
    files.append(
        Artifact(path="bill_of_materials.csv", kind="csv", units="g", content=bill_csv(items))
    )
    tell("process sheet", 0.95)
    files += process_files(design, shop, solids, items)
    if step:
        tell("STEP", 0.97)
        files.append(step_file(design, shop))
    return Bundle(
        design=design, files=tuple(sorted(files, key=lambda file: file.path)), items=tuple(items)
    )


def write_bundle(bundle: Bundle, out: Path, *, force: bool = False) -> tuple[Path, ...]:
    """Write a bundle into a folder, the manifest last.

    With `force` it replaces an earlier bundle whole: files that only the earlier manifest names go.

    Raises
    ------
    FileError
        If files exist already and `force` is not given, or cannot be written.
    """
    check_output(out, folder=True)
    contents = {file.path: file.content for file in bundle.files}
    contents[MANIFEST] = bundle.manifest
    for path in contents:
        if (out / path).parent.is_dir():
            check_output(out / path, force=force)
    for stale in _earlier(out) - set(contents):
        (out / stale).unlink(missing_ok=True)
    for path, content in contents.items():
        check_output((out / path).parent, folder=True)
        write_output(out / path, content)
    return tuple(out / path for path in contents)


def _earlier(out: Path) -> set[str]:
    """Files in a folder that an earlier manifest names, and that are as it left them."""
    try:
        listed = json.loads(read_text(out / MANIFEST))["files"]
        sums = {str(file["path"]): file["sha256"] for file in listed}
        home = out.resolve()
        return {
            path
            for path, digest in sums.items()
            if (out / path).resolve().is_relative_to(home)
            and (out / path).is_file()
            and hashlib.sha256((out / path).read_bytes()).hexdigest() == digest
        }
    except (OSError, ValueError, KeyError, TypeError):
        return set()
