"""Makes the response table of a design and writes it, with what there is to say of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.response import Effort, make_response_table
from smoskin.design.skin import SkinDesign
from smoskin.sensing.response.table import ResponseTable

if TYPE_CHECKING:
    from rich.table import Table

Progress = Callable[[str, float], None]
"""Is told what is being pressed, and the share of the whole work that is done."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WrittenTable:
    """A response table and its file."""

    table: ResponseTable
    file: Path

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        table = self.table
        return {
            "file": str(self.file),
            "design_hash": table.design_hash,
            "chips": list(table.chips),
            "forces_N": list(table.forces),
            "modes": len(table.modes),
            "misfit_uT_per_N": [float(one) for one in self._misfit_microtesla()],
        }

    def rows(self) -> "Table":
        """The same, for people."""
        from rich.table import Table

        table = Table(title=str(self.file), show_header=False)
        low, high = self.table.forces
        missed = ", ".join(f"{one:.1f}" for one in self._misfit_microtesla())
        for name, value in (
            ("chips", ", ".join(str(chip) for chip in self.table.chips)),
            ("normal forces", f"{low:.2f} to {high:.2f} N"),
            ("ways in which made skins differ", str(len(self.table.modes))),
            ("missed of each signal, uT for a newton", missed),
        ):
            table.add_row(name, value)
        return table

    def _misfit_microtesla(self) -> Floats:
        """What the table misses of each signal, (C,), uT for a newton."""
        return np.asarray(np.sqrt(np.diag(self.table.misfit)) * 1e6)


def write_table(
    design: SkinDesign,
    out: Path,
    *,
    presses: int | None = None,
    pairs: int | None = None,
    skins: int | None = None,
    seed: int = 0,
    progress: Progress = lambda task, share: None,
) -> WrittenTable:
    """Press the twin of a design and write its response table.

    Parameters
    ----------
    design : SkinDesign
    out : Path
    presses, pairs, skins : int, optional
        As `smoskin.commands.response.Effort`, which has the numbers that are not given.
    seed : int
    progress : callable

    Raises
    ------
    ArgumentError
        If a number cannot be.
    MissingExtraError
        If the extras `twin` and `learned` are not installed.
    """
    usual = Effort(seed=seed)
    effort = replace(
        usual,
        presses=usual.presses if presses is None else presses,
        pairs=usual.pairs if pairs is None else pairs,
        skins=usual.skins if skins is None else skins,
    )
    table = make_response_table(design, effort, progress=progress)
    table.save(out)
    return WrittenTable(table=table, file=out)
