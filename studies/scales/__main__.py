"""``python -m studies.scales``: contact laws of elastomer covers of several thicknesses."""

from smoskin.cli.frame import show
from smoskin.feasibility import load_design
from studies.scales.law import REGIONS, Sheet, fit_law


def main(design: str = "planar") -> None:
    """Print the best law for covers of 1 to 4 mm, patches of 2 and 4 mm."""
    from rich.table import Table

    table = Table(title="Contact laws of elastomer covers")
    for heading in ("region", "cover mm", "patch mm", "spread mm", "rim", "missed", "bilinear"):
        table.add_column(heading, justify="right")
    sheet = Sheet(load_design(design))
    for thickness in (1e-3, 2e-3, 4e-3):
        for patch in (2e-3, 4e-3):
            for region in REGIONS:
                fit = fit_law(sheet, region, thickness, patch)
                table.add_row(
                    region,
                    f"{1e3 * thickness:g}",
                    f"{1e3 * patch:g}",
                    f"{1e3 * fit.spread:.1f}",
                    f"{fit.rim:.2f}",
                    f"{fit.missed:.1%}",
                    f"{fit.missed_bilinear:.1%}",
                )
    show(table)


if __name__ == "__main__":
    main()
