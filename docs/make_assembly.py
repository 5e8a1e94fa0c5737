"""Makes docs/assembly*.png: pages `assembly.html` of two designs, together and apart."""

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURES = {"planar": "assembly.png", "curved": "assembly_curved.png"}


def main() -> None:
    """Take the pictures of every design."""
    for name, picture in PICTURES.items():
        draw(name, ROOT / "docs" / picture)


def draw(name: str, picture: Path) -> None:
    """Write a design's page and take its pictures in the system's Chromium."""
    sys.path.insert(0, str(ROOT / "tests"))
    from PIL import Image
    from playwright.sync_api import sync_playwright

    from chromium import _ARGUMENTS, CHROMIUM
    from smoskin.design.document import read_design
    from smoskin.fabrication.moulds.assembly import whole_skin
    from smoskin.fabrication.pattern.flat import flat_sheet
    from smoskin.fabrication.process.view import view
    from smoskin.fabrication.workshop import Workshop

    design, shop = read_design(name), Workshop()
    page = view(whole_skin(design, flat_sheet(design, shop), shop), name, ["M1"])
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        place = Path(folder) / "assembly.html"
        place.write_bytes(page)
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(_ARGUMENTS))
        tab = browser.new_page(viewport={"width": 800, "height": 800})
        tab.goto(place.as_uri())
        shots = []
        for k, apart in enumerate(("0", "1")):
            tab.locator("#apart").fill(apart)
            tab.wait_for_timeout(500)
            if k:
                tab.evaluate("document.querySelector('form').hidden = true")
            shot = Path(folder) / f"{k}.png"
            tab.screenshot(path=shot)
            shots.append(Image.open(shot).convert("RGB"))
        browser.close()
        both = Image.new("RGB", (1600, 800))
        for k, shot_image in enumerate(shots):
            both.paste(shot_image, (800 * k, 0))
        both.quantize(64).save(picture, optimize=True)


if __name__ == "__main__":
    main()
