"""The process sheet as a page for a browser and as a PDF for the bench."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.drawing import pdf_of, pdf_path, pdf_text
from smoskin.fabrication.materials import Item
from smoskin.fabrication.moulds.solids import Part
from smoskin.fabrication.process.pictures import Picture
from smoskin.fabrication.process.readings import FirstReading, Suited
from smoskin.fabrication.process.steps import Step
from smoskin.fabrication.process.tolerances import Tolerance

_A4: Final = (210.0, 297.0)
_MARGIN: Final = 15.0
_BODY: Final = 3.2
"""mm: height of the PDF's text."""
_POINTS: Final = 72 / 25.4
_STYLE: Final = (
    "body{font:16px/1.45 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #bbb;padding:.3em .6em;"
    "text-align:left}svg{width:100%;max-height:26em}figcaption{color:#555}"
    "li.check::marker{content:'\\2610  '}h2{border-top:1px solid #ccc;padding-top:.6em}"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sheet:
    """All that a process sheet tells."""

    design: SkinDesign
    steps: tuple[Step, ...]
    items: tuple[Item, ...]
    tools: tuple[Part, ...]
    """Moulds and jigs, before they are split."""
    tolerances: tuple[Tolerance, ...]
    readings: tuple[FirstReading, ...]
    suited: tuple[Suited, ...]

    @property
    def title(self) -> str:
        """The page's title."""
        return f"Building the skin {self.design.name} ({self.design.content_hash[:12]})"

    @property
    def tables(self) -> list[tuple[str, list[list[str]]]]:
        """Tables with their titles, the first row of each its head."""
        bill = [["part", "quantity", "material", "mass, g", "note"]]
        bill += [
            [i.part, f"{i.quantity:g}", i.material, f"{i.mass_g:.2f}", i.note] for i in self.items
        ]
        tools = [["mould or jig", "what it is", "size, mm", "may be made of"]]
        tools += [
            [
                part.name,
                part.title,
                " x ".join(f"{1e3 * side:.0f}" for side in part.size),
                ", ".join(part.made_of),
            ]
            for part in self.tools
        ]
        limits = [["what", "limit", "effect", "check"]]
        limits += [[t.what, t.text, t.effect, t.check] for t in self.tolerances]
        first = [["chip", "address", "x, mT", "y, mT", "z, mT"]]
        first += [
            [r.chip, f"0x{r.address:02x}", *(_between(r, axis) for axis in range(3))]
            for r in self.readings
        ]
        chips = [f"gap of {site.name}, mm" for site in self.design.halls]
        suited = [["remanence, T", "one magnet over one chip, mT", *chips, "gain_selection"]]
        suited += [
            [
                f"{s.remanence:.1f}",
                f"{1e3 * s.reading:.1f}",
                *(f"{1e3 * gap:.1f}" for gap in s.gaps),
                str(s.gain),
            ]
            for s in self.suited
        ]
        return [
            ("Bill of materials", bill),
            ("Moulds and jigs, and what each may be made of", tools),
            ("Tolerances: the twin's made skins are drawn from the same table", limits),
            ("Magnets by what one of them reads over one chip at the design's gap", suited),
            ("First power-up: readings of a good skin, untouched, in the chips' own axes", first),
        ]


def _between(reading: FirstReading, axis: int) -> str:
    """Designed value and the range of good skins, mT."""
    designed, low, high = (
        1e3 * float(values[axis]) for values in (reading.designed, reading.low, reading.high)
    )
    return f"{designed + 0.0:.1f} ({low:.1f} to {high:.1f})"


def html(sheet: Sheet) -> bytes:
    """The sheet as one file for a browser, nothing loaded from outside."""
    out = [
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(sheet.title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(sheet.title)}</h1>",
    ]
    for number, step in enumerate(sheet.steps, 1):
        figure = f" <small>SI Figure S4 {escape(step.figure)}</small>" if step.figure else ""
        out.append(f"<h2>{number}. {escape(step.title)}{figure}</h2><ol>")
        out += [f"<li>{escape(action)}</li>" for action in step.actions]
        out.append("</ol><ul>")
        out += [f'<li class="check">{escape(check)}</li>' for check in step.checks]
        out.append("</ul>")
        if step.picture is not None:
            out.append(_svg(step.picture))
    for title, rows in sheet.tables:
        out.append(f"<h2>{escape(title)}</h2><table>")
        for k, row in enumerate(rows):
            cell = "td" if k else "th"
            out.append("<tr>" + "".join(f"<{cell}>{escape(c)}</{cell}>" for c in row) + "</tr>")
        out.append("</table>")
    return ("\n".join([*out, "</body></html>"]) + "\n").encode()


def _svg(picture: Picture) -> str:
    """A picture within a page."""
    low, high = 1e3 * picture.box
    wide, tall = np.maximum(high - low, 1.0) + 2.0
    ink = 0.002 * max(wide, tall)
    lines = [
        f'<figure><svg viewBox="{low[0] - 1:.3f} {-high[1] - 1:.3f} {wide:.3f} {tall:.3f}" '
        f'role="img"><title>{escape(picture.caption)}</title>'
    ]
    for shape in picture.shapes:
        points = " ".join(f"{x:.3f},{-y:.3f}" for x, y in (1e3 * shape.points).tolist())
        name = "polygon" if shape.closed else "polyline"
        lines.append(
            f'<{name} points="{points}" fill="{shape.fill or "none"}" stroke="{shape.stroke}" '
            f'stroke-width="{ink:.3f}"/>'
        )
    return "\n".join([*lines, f"</svg><figcaption>{escape(picture.caption)}</figcaption></figure>"])


class _Writer:
    """Fills A4 pages from the top."""

    def __init__(self) -> None:
        self.pages: list[list[str]] = []
        self.y = 0.0
        self._turn()

    def _turn(self) -> None:
        """Begin a page."""
        self.pages.append([f"{_POINTS:.9f} 0 0 {_POINTS:.9f} 0 0 cm 0.15 w 1 j"])
        self.y = _A4[1] - _MARGIN

    def room(self, height: float) -> None:
        """Begin a page unless so many mm are left."""
        if self.y - height < _MARGIN:
            self._turn()

    def text(self, text: str, size: float = _BODY, indent: float = 0.0) -> None:
        """Write a paragraph."""
        for line in _wrapped(text, _A4[0] - 2 * _MARGIN - indent, size):
            self.room(1.4 * size)
            self.y -= 1.4 * size
            self.pages[-1].append(pdf_text(_MARGIN + indent, self.y, line, size))

    def picture(self, picture: Picture, tall: float = 75.0) -> None:
        """Draw a picture with its caption."""
        low, high = picture.box
        extent = np.maximum(high - low, 1e-6)
        scale = min((_A4[0] - 2 * _MARGIN) / extent[0], tall / extent[1])
        height = float(scale * extent[1])
        self.room(height + 10)
        self.y -= height + 2
        shift: Floats = np.array([_MARGIN, self.y])
        for shape in picture.shapes:
            points = (shape.points - low) * scale + shift
            colours = f"{_rgb(shape.stroke)} RG"
            if shape.fill:
                colours += f" {_rgb(shape.fill)} rg"
            path = pdf_path(points, closed=shape.closed, fill=shape.fill is not None)
            self.pages[-1].append(f"{colours} {path}")
        self.text(picture.caption, 0.85 * _BODY)
        self.y -= 3

    def table(self, rows: Sequence[Sequence[str]]) -> None:
        """Write a table, its columns as wide as their longest cells ask for."""
        size = 0.8 * _BODY
        longest = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        wanted = np.minimum(longest, 45) + 2.0
        widths = (_A4[0] - 2 * _MARGIN) * wanted / wanted.sum()
        for row in rows:
            cells = [_wrapped(c, w - 1.5, size) for c, w in zip(row, widths, strict=True)]
            height = max(map(len, cells)) * 1.3 * size + 1.2
            self.room(height)
            x = _MARGIN
            for lines, width in zip(cells, widths, strict=True):
                for k, line in enumerate(lines):
                    y = self.y - (k + 1) * 1.3 * size
                    self.pages[-1].append(pdf_text(x, y, line, size))
                x += float(width)
            self.y -= height
            rule = np.array([[_MARGIN, self.y], [_A4[0] - _MARGIN, self.y]])
            self.pages[-1].append("0.7 0.7 0.7 RG " + pdf_path(rule, closed=False))


def pdf_sheet(sheet: Sheet) -> bytes:
    """The sheet on A4 pages."""
    writer = _Writer()
    writer.text(sheet.title, 6.0)
    for number, step in enumerate(sheet.steps, 1):
        writer.room(45)
        writer.y -= 3
        figure = f"  (SI Figure S4 {step.figure})" if step.figure else ""
        writer.text(f"{number}. {step.title}{figure}", 4.5)
        writer.y -= 1
        for action in step.actions:
            writer.text(f"-  {action}", indent=3)
        for check in step.checks:
            writer.text(f"[  ]  check: {check}", indent=3)
        writer.y -= 2
        if step.picture is not None:
            writer.picture(step.picture)
    for title, rows in sheet.tables:
        writer.room(40)
        writer.y -= 4
        writer.text(title, 4.5)
        writer.y -= 1
        writer.table(rows)
    pages = []
    for number, ink in enumerate(writer.pages, 1):
        foot = pdf_text(_MARGIN, 8, f"{sheet.title}, page {number} of {len(writer.pages)}", 2.5)
        pages.append((_A4, "\n".join([*ink, foot])))
    return pdf_of(pages, sheet.title)


def _wrapped(text: str, width: float, size: float) -> list[str]:
    """Lines no wider than so many mm, by a letter's mean width in Helvetica."""
    most, lines, line = max(int(width / (0.5 * size)), 4), [], ""
    for word in text.split():
        while len(word) > most:
            lines += [line] if line else []
            line, word = "", word
            lines.append(word[:most])
            word = word[most:]
        if line and len(line) + 1 + len(word) > most:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line] if line else lines or [""]


def _rgb(colour: str) -> str:
    """A colour as a PDF has it."""
    return " ".join(f"{int(colour[k : k + 2], 16) / 255:.3f}" for k in (1, 3, 5))
