"""KiCad's own engine on boards, run by the system's Python, which alone has pcbnew (KiCad 6).

Usage: kicad_engine.py BOARD.kicad_pcb ... ; prints a JSON list, one record a board. Gerbers are
plotted beside the board in a folder `plots`.
"""

import json
import re
import sys
from pathlib import Path


def checked(path: Path) -> dict:
    import pcbnew

    board = pcbnew.LoadBoard(str(path))
    report = path.with_suffix(".rpt")
    assert pcbnew.WriteDRCReport(board, str(report), pcbnew.EDA_UNITS_MILLIMETRES, True)
    text = report.read_text()
    settings = board.GetDesignSettings()
    return {
        "violations": int(re.search(r"Found (\d+) DRC violations", text).group(1)),
        "unconnected": int(re.search(r"Found (\d+) unconnected", text).group(1)),
        "kinds": sorted(set(re.findall(r"^\[(\w+)\]", text, re.MULTILINE))),
        "severities": sorted(set(re.findall(r"Severity: (\w+)", text))),
        "report": text,
        "clearance": settings.m_MinClearance / 1e6,
        "hole_to_hole": settings.m_HoleToHoleMin / 1e6,
        "nets": {
            f"{footprint.GetReference()}.{pad.GetNumber()}": pad.GetNetname()
            for footprint in board.GetFootprints()
            for pad in footprint.Pads()
            if pad.GetNumber()
        },
        "places": {
            f.GetReference(): [
                (f.GetPosition().x - settings.GetAuxOrigin().x) / 1e6,
                -(f.GetPosition().y - settings.GetAuxOrigin().y) / 1e6,
                f.GetOrientationDegrees(),
                "bottom" if f.IsFlipped() else "top",
            ]
            for f in board.GetFootprints()
        },
    }


def plot(path: Path) -> None:
    import pcbnew

    board = pcbnew.LoadBoard(str(path))
    controller = pcbnew.PLOT_CONTROLLER(board)
    options = controller.GetPlotOptions()
    options.SetOutputDirectory(str(path.parent / "plots"))
    options.SetUseAuxOrigin(True)
    options.SetPlotFrameRef(False)
    options.SetUseGerberX2format(True)
    options.SetPlotViaOnMaskLayer(False)
    options.SetDrillMarksType(0)
    options.SetPlotReference(False)
    options.SetPlotValue(False)
    options.SetSubtractMaskFromSilk(False)
    for name, layer in (
        ("F_Cu", pcbnew.F_Cu),
        ("B_Cu", pcbnew.B_Cu),
        ("F_Mask", pcbnew.F_Mask),
        ("B_Mask", pcbnew.B_Mask),
        ("F_Paste", pcbnew.F_Paste),
        ("B_Paste", pcbnew.B_Paste),
        ("F_Silkscreen", pcbnew.F_SilkS),
        ("B_Silkscreen", pcbnew.B_SilkS),
        ("Edge_Cuts", pcbnew.Edge_Cuts),
    ):
        controller.SetLayer(layer)
        controller.OpenPlotfile(name, pcbnew.PLOT_FORMAT_GERBER, name)
        controller.PlotLayer()
    controller.ClosePlot()
    drills = pcbnew.EXCELLON_WRITER(board)
    drills.SetOptions(False, True, board.GetDesignSettings().GetAuxOrigin(), False)
    drills.SetFormat(True)
    drills.CreateDrillandMapFilesSet(str(path.parent / "plots"), True, False)


if __name__ == "__main__":
    answers = []
    for given in sys.argv[1:]:
        answers.append(checked(Path(given)))
        plot(Path(given))
    print(json.dumps(answers))
