"""Writes docs/errata.md from the entries and numbers that `python -m paper` lists.

Run ``python docs/make_errata.py`` after changing `errata.toml` or the reference design; a test
fails while the page differs.
"""

from pathlib import Path

from paper.errata import page
from smoskin.feasibility import load_design

PAGE = Path(__file__).parent / "errata.md"

if __name__ == "__main__":
    PAGE.write_text(page(load_design("planar")), encoding="utf-8")
