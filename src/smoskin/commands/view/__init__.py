"""Any file of a skin on a page: what `smoskin view` does.

Decides how each kind is looked at: recordings are played, designs and what reads a skin are tried
on a virtual one, sheets fold with their strain in colour, and bodies lie still.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from smoskin.commands.check import check_file, kind_of
from smoskin.commands.run import Watch
from smoskin.commands.view.pages import fold_page, folder_page, mesh_page
from smoskin.design.document import shipped_designs
from smoskin.errors import ArgumentError, FileError
from smoskin.origami.pattern import read_forms
from smoskin.roles import Resource
from smoskin.service.page.server import StillPage

_MESHES: Final = (".stl", ".obj", ".ply")
_RECORDING, _DESIGN, _PATTERN = "a recording", "a design", "a crease pattern (FOLD)"
_READERS: Final = ("a response table", "a network", "a calibration of the paper's forms")


class Shown(Resource):
    """A file on a page; iterating goes on as long as anything on the page does.

    Parameters
    ----------
    file : path
        A recording, a design or the name of a shipped one, a response table, a network, a
        calibration, a FOLD document, a mesh (STL, OBJ, PLY), or a folder of `smoskin tessellate`
        or `smoskin fabricate`.
    design : str, optional
        Name or path of the design where what reads a skin is of none that is shipped.
    port : int
        TCP port of the page; 0 takes a free one.
    say : callable
        Called with sentences about what is going on.

    Raises
    ------
    ArgumentError
        If the file is of a kind that cannot be seen, or the port is taken.
    FileError
        If it cannot be read or is damaged.
    DesignError
        If there is no such design, or a FOLD document has no faces.
    """

    def __init__(
        self,
        file: Path,
        *,
        design: str | None = None,
        port: int = 0,
        say: Callable[[str], object] = lambda sentence: None,
    ) -> None:
        self.watch: Watch | None = None
        """What goes on on the page; None where it is still."""
        self._page: StillPage | None = None
        content = _still_page(file)
        if content is None:
            source, reader = _source_of(file, design)
            if reader is not None:
                say("The skin is a virtual one, as designed; the mouse presses it.")
            self.watch = Watch(
                source, calibration=reader, uncalibrated=True, view=True, port=port, say=say
            )
            self.url = self.watch.url
        else:
            self._page = StillPage(content, port=port)
            self.url = self._page.url
            say(f"{file.name} is shown at {self.url}")

    def __iter__(self) -> Iterator[float]:
        """Times of the readings that are shown, s; none where the page is still."""
        for estimate in self.watch or ():
            yield estimate.time

    def close(self) -> None:
        """End the page."""
        for part in (self.watch, self._page):
            if part is not None:
                part.close()


def _still_page(file: Path) -> bytes | None:
    """The page of what does not go on by itself; None for anything else."""
    if file.is_dir():
        return folder_page(file)
    if file.suffix.lower() in _MESHES:
        return mesh_page(file)
    if file.is_file() and kind_of(file) == _PATTERN:
        return fold_page(read_forms(file), file.name)
    return None


def _source_of(file: Path, design: str | None) -> tuple[str, Path | None]:
    """Source of the readings of a file, and the file where it reads them."""
    if str(file) in shipped_designs():
        return f"twin://{file}", None
    try:
        kind = kind_of(file)
    except OSError as error:
        raise FileError(f"{file} cannot be read: {error.strerror}") from error
    if kind in (_RECORDING, _DESIGN):
        return (f"replay:{file}" if kind == _RECORDING else f"twin://{file}"), None
    if kind not in _READERS:
        raise ArgumentError(
            f"file must be a recording, a design, what reads a skin, a FOLD document or a mesh; "
            f"{file} is {kind}, of which smoskin check {file} tells"
        )
    checked = check_file(file)
    if checked.problem:
        raise FileError(f"{file}: {checked.problem}")
    name = design or checked.facts["design"].split(" ")[0]
    if design is None and name not in shipped_designs():
        raise ArgumentError(f"design must be given: {file} is of {name}, which is not shipped")
    return f"twin://{name}", file
