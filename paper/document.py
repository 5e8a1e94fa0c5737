"""The report as a PDF of vector pages: figures with their captions, then the rows as tables."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Final

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox

from paper.page import deviation_text, number_text, summary
from paper.rows import Row
from paper.style import GREY, INK, Plate, styled

_WIDTH, _HEIGHT = 11.7, 8.3
"""Inches: A4, lying."""
_MARGIN: Final = 0.4
"""Inches, round a figure."""
_LINE: Final = 0.0143
"""Height of a line of a table, of the page's."""
_COLUMNS: Final = (
    (0.03, 22), (0.135, 18), (0.225, 36), (0.39, 46), (0.61, 12), (0.675, 11), (0.74, 52),
)  # fmt: skip
"""Left edge of each column, of the page's width, and its letters a line."""
_HEAD: Final = ("", "where", "printed", "computed", "deviation", "verdict", "why")


def write_document(path: Path, title: str, rows: Sequence[Row], plates: Sequence[Plate]) -> int:
    """Write the PDF; returns its number of pages."""
    # No date inside, so that the same data give the same bytes.
    with styled(), PdfPages(path, metadata={"Title": title, "CreationDate": None}) as pdf:
        for plate in plates:
            caption = "\n".join(wrap(plate.caption, 105))
            below = plate.figure.text(0.02, -0.02, caption, va="top", fontsize=8, linespacing=1.4)
            pdf.savefig(plate.figure, bbox_inches=_paper(plate.figure, caption.count("\n") + 1))
            below.remove()
        for page in _table_pages(title, rows):
            pdf.savefig(page)
        return int(pdf.get_pagecount())


def _paper(figure: Figure, lines: int) -> Bbox:
    """The figure with a margin and room for a caption of so many lines, inches."""
    width, height = figure.get_size_inches()
    below = 0.02 * height + 0.16 * lines + _MARGIN
    return Bbox([[-_MARGIN, -below], [width + _MARGIN, height + _MARGIN]])


def _table_pages(title: str, rows: Sequence[Row]) -> list[Figure]:
    """Rows on as many pages as they need."""
    pages: list[Figure] = []
    height = 0.0
    for row in rows:
        texts = (
            row.id, row.place, number_text(row.printed), number_text(row.computed),
            deviation_text(row), row.verdict, row.why,
        )  # fmt: skip
        cells = [
            wrap(text, letters) or [""] for text, (_, letters) in zip(texts, _COLUMNS, strict=True)
        ]
        needed = (max(len(cell) for cell in cells) + 0.6) * _LINE
        if not pages or height - needed < 0.05:
            pages.append(_empty_page(f"{title}. {summary(rows)}", len(pages) + 1))
            height = 0.885
        page = pages[-1]
        for cell, (left, _) in zip(cells, _COLUMNS, strict=True):
            page.text(left, height, "\n".join(cell), va="top", fontsize=6.5, linespacing=1.25)
        height -= needed
        page.add_artist(_rule(height + 0.25 * _LINE))
    return pages


def _empty_page(title: str, number: int) -> Figure:
    """A page with its heading and the table's."""
    page = Figure(figsize=(_WIDTH, _HEIGHT))
    page.text(0.03, 0.945, f"{title} (table, page {number})", fontsize=9, color=INK)
    for name, (left, _) in zip(_HEAD, _COLUMNS, strict=True):
        page.text(left, 0.905, name, fontsize=7, weight="bold", color=INK)
    page.add_artist(_rule(0.897))
    return page


def _rule(height: float) -> Line2D:
    """A thin line across the page."""
    return Line2D([0.03, 0.97], [height, height], color=GREY, linewidth=0.3)
