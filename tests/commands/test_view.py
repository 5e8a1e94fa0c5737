"""Any file on a page: what is shown of each kind, and what is refused."""

import gzip
import json
import re
import threading
from http.client import HTTPConnection
from importlib import resources
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from typer.testing import CliRunner

from chromium import open_page
from pages import assert_gone
from smoskin.cli import app
from smoskin.commands.view import Shown
from smoskin.commands.view.pages import _strain, fold_page
from smoskin.errors import ArgumentError, DesignError, FileError
from smoskin.origami.pattern import FoldedForms, read_forms
from smoskin.origami.surface.mesh import format_stl

pytest.importorskip("websockets")

SQUARE = [[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [20, 0, 0], [20, 10, 0]]
FOLDED = [*SQUARE[:4], [10, 0, 10], [10, 10, 10]]
FACES = [[0, 1, 2, 3], [1, 4, 5, 2]]


def folds(**more: object) -> dict[str, object]:
    """A hinge of two squares, folded by a right angle, that was flat."""
    flat = {"frame_parent": 0, "frame_inherit": True, "vertices_coords": SQUARE}
    return {"file_spec": 1.1, "vertices_coords": FOLDED, "faces_vertices": FACES,
            "file_frames": [flat]} | more  # fmt: skip


@pytest.fixture
def hinge(tmp_path):
    path = tmp_path / "hinge.fold"
    path.write_text(json.dumps(folds()))
    return path


def fetched(url):
    """The page at an address, as its text."""
    parts = urlsplit(url)
    connection = HTTPConnection(parts.hostname, parts.port, timeout=10.0)
    connection.request("GET", f"{parts.path}?{parts.query}")
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, gzip.decompress(body).decode() if answer.status == 200 else body.decode()


def test_a_sheet_folds_from_flat_to_its_form_without_strain(hinge):
    forms = read_forms(hinge)
    np.testing.assert_allclose(1e3 * forms.frames, [SQUARE, FOLDED])
    assert forms.faces == ((0, 1, 2, 3), (1, 4, 5, 2))
    page = fold_page(forms, "hinge <1>").decode()
    (sheet,) = json.loads(re.search(r"(\[\{\"name\": \"sheet\".*?\}\])[;,\n<]", page)[1])
    assert (sheet["frames"], sheet["shades"][0]["name"]) == (2, "strain")
    assert "hinge &lt;1&gt;" in page


def test_strain_is_the_largest_change_of_a_face_s_lengths():
    stretched = np.array([SQUARE, FOLDED], dtype=float)
    stretched[1, [4, 5], 2] = 10.1  # of 10
    forms = FoldedForms(frames=stretched, faces=tuple(map(tuple, FACES)))
    strains = [_strain(forms.frames, face) for face in forms.faces]
    np.testing.assert_allclose(strains, [[0, 0], [0, 0.01]], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"faces_vertices": []}, "faces_vertices must name three"),
        ({"faces_vertices": [[0, 1]]}, "faces_vertices must name three"),
        ({"faces_vertices": [[0, 1, 6]]}, "vertices 0 to 5; got 6"),
        ({"vertices_coords": FOLDED[:5]}, "the same vertices"),
        ({"vertices_coords": [[0, 0, "nan"]]}, "finite numbers"),
        ({"faces_vertices": 7}, "must be a FOLD document"),
    ],
)
def test_sheets_that_cannot_be_shown_are_refused_by_name(tmp_path, change, sentence):
    path = tmp_path / "odd.fold"
    path.write_text(json.dumps(folds(**change)))
    with pytest.raises(DesignError, match=sentence) as refusal:
        Shown(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_what_lies_still_is_served_to_who_has_the_address(hinge, tmp_path):
    pytest.importorskip("trimesh")
    mesh = tmp_path / "part.stl"
    mesh.write_bytes(format_stl(1e-3 * np.array(FOLDED, float), np.array([[0, 1, 2]]), "part"))
    folder = tmp_path / "made"
    folder.mkdir()
    (folder / "assembly.html").write_text("<p>taken apart</p>")
    before = set(threading.enumerate())
    for file, content in ((hinge, "strain"), (mesh, "part.stl"), (folder, "taken apart")):
        with Shown(file) as shown:
            assert list(shown) == []
            status, page = fetched(shown.url)
            assert (status, content in page) == (200, True)
            assert fetched(shown.url.split("?")[0])[0] == 403
            assert fetched(shown.url.replace("/?", "/else?"))[0] == 404
        shown.close()
    assert_gone(before)


def test_what_cannot_be_seen_is_refused_in_one_sentence(tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("nothing of ours")
    for file, kind, sentence in (
        (text, ArgumentError, "file must be a recording, a design"),
        (tmp_path, ArgumentError, "fold.html or assembly.html"),
        (tmp_path / "none.mcap", FileError, "No such file"),
        (tmp_path / "none.stl", FileError, "none.stl"),
    ):
        with pytest.raises(kind, match=sentence) as refusal:
            Shown(Path(file))
        assert "\n" not in str(refusal.value)
    done = CliRunner().invoke(app, ["view", str(text)])
    assert done.exit_code == 1


@pytest.mark.slow
def test_what_reads_a_skin_is_tried_on_a_virtual_one_of_its_design(tmp_path):
    pytest.importorskip("viser")
    pytest.importorskip("safetensors")
    table = resources.files("smoskin.sensing.response") / "planar.table"
    sentences: list[str] = []
    with resources.as_file(table) as path, Shown(path, say=sentences.append) as shown:
        assert "virtual one, as designed" in sentences[0]
        times = [time for time, _ in zip(shown, range(25), strict=False)]
        assert (np.diff(times) > 0).all()
        assert shown.watch.summary.statuses["NO_CONTACT"] >= 5  # after a zero of 20 readings


@pytest.mark.slow
@pytest.mark.browser
def test_the_slider_folds_the_sheet_in_the_browser(hinge):
    with Shown(hinge) as shown, open_page(shown.url) as opened:
        slider = opened.page.locator("input[type=range]")
        slider.wait_for()
        folded = opened.page.screenshot()
        slider.fill("0")
        opened.wait_until(lambda: opened.page.screenshot() != folded)
