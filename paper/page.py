"""The report as one web page that asks for nothing: figures are part of it."""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

from paper.rows import TOLERANCE, Row

_MARKS: Final = {"reproduced": "✓", "corrected": "✎", "unresolved": "?"}
_STYLE: Final = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 80rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.5rem; }
table { border-collapse: collapse; width: 100%; font-size: 0.85rem; }
th, td { text-align: left; vertical-align: top; padding: 0.3rem 0.6rem;
         border-bottom: 1px solid #e2e2e2; overflow-wrap: break-word; }
th { font-weight: 600; border-bottom: 1px solid #8c8c8c; }
td.number { font-variant-numeric: tabular-nums; }
td.whole { white-space: nowrap; }
.reproduced { color: #00664b; } .corrected { color: #0072B2; } .unresolved { color: #a84600; }
figure { margin: 1.5rem 0; } img { width: 100%; max-width: 52rem; display: block; }
figcaption { font-size: 0.85rem; color: #444; max-width: 52rem; }
"""


def html_page(design: str, rows: Sequence[Row], figures: Sequence[tuple[Path, str, str]]) -> str:
    """The page.

    Parameters
    ----------
    design : str
        Name and hash of the design, for the heading.
    rows : sequence of Row
    figures : sequence of (path, title, caption)
        SVG files.
    """
    errata = [row for row in rows if row.id[0] in "EU"]
    values = [row for row in rows if row.id[0] not in "EU"]
    body = [
        "<h1>The paper, printed and computed</h1>",
        f"<p>Design {escape(design)}. {summary(rows)} A number counts as reproduced within "
        f"{TOLERANCE:.1%}.</p>",
        "<h2>Printed values and statements</h2>",
        _table(values),
        "<h2>Figures</h2>",
        *(_figure(*figure) for figure in figures),
        "<h2>Errata</h2>",
        _table(errata),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>smoskin report: {escape(design)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        "<body>\n" + "\n".join(body) + "\n</body>\n</html>\n"
    )


def summary(rows: Sequence[Row]) -> str:
    """How many rows have which verdict, as a sentence."""
    counts = [f"{sum(row.verdict == verdict for row in rows)} {verdict}" for verdict in _MARKS]
    return f"{len(rows)} rows: {', '.join(counts)}."


def number_text(value: float | str) -> str:
    """A value as people read it."""
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if float(value).is_integer() else f"{value:.6g}"


def deviation_text(row: Row) -> str:
    """A deviation in percent; empty where there is none to tell."""
    if row.deviation is None:
        return ""
    percent = 100 * row.deviation
    if percent == 0:
        return "0 %"
    return f"{percent:+.3g} %" if abs(percent) >= 1e-4 else "below 1e-4 %"


def _table(rows: Sequence[Row]) -> str:
    head = ("", "where", "printed", "computed", "deviation", "verdict", "why")
    lines = [
        "<table>",
        "<thead><tr>" + "".join(f"<th>{one}</th>" for one in head) + "</tr></thead>",
    ]
    lines.append("<tbody>")
    for row in rows:
        cells = (
            ("whole", row.id),
            ("", row.place),
            ("number", number_text(row.printed)),
            ("number", number_text(row.computed)),
            ("number whole", deviation_text(row)),
            (f"whole {row.verdict}", f"{_MARKS[row.verdict]} {row.verdict}"),
            ("", row.why),
        )
        lines.append(
            f'<tr id="{escape(row.id)}">'
            + "".join(f'<td class="{kind}">{escape(text)}</td>' for kind, text in cells)
            + "</tr>"
        )
    return "\n".join([*lines, "</tbody>", "</table>"])


def _figure(path: Path, title: str, caption: str) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure id="{escape(path.stem)}"><img alt="{escape(title)}" '
        f'src="data:image/svg+xml;base64,{data}"><figcaption>{escape(caption)}</figcaption></figure>'
    )
