"""Crease patterns of others: which vertices cannot fold flat, and why."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.errors import DesignError
from smoskin.origami.pattern import CreasePattern, broken_rules, read_pattern


def star(sectors, letters):
    """A vertex in the middle of as many creases, each a length of its own, turned by 0.3 rad."""
    angles = 0.3 + np.concatenate([[0.0], np.cumsum(sectors)[:-1]])
    ends = (
        np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.arange(1, len(angles) + 1)[:, None]
    )
    places = np.vstack([[0.0, 0.0], ends])
    spokes = [[0, k + 1] for k in range(len(angles))]
    rim = [[k + 1, (k + 1) % len(angles) + 1] for k in range(len(angles))]
    return CreasePattern(
        vertices=places, edges=spokes + rim, assignments=(*letters, *"B" * len(angles))
    )


def rules(pattern):
    return [(broken.vertex, broken.rule) for broken in broken_rules(pattern)]


# At the tolerance itself rounding decides.
OFF = st.floats(-0.15, 0.15).filter(lambda off: abs(abs(off) - 1e-4) > 1e-9)


@given(st.floats(0.2, 1.3), st.floats(0.2, 1.3), OFF)
def test_four_creases_fold_flat_where_opposite_sectors_add_up_to_half_a_turn(first, second, off):
    sectors = np.array([first, second, np.pi - first, np.pi - second])
    # The odd one out is beside the smallest sector.
    letters = ["M"] * 4
    letters[int(np.argmin(sectors))] = "V"
    assert rules(star(sectors, letters)) == []
    bent = np.add(sectors, [off, -off, 0.0, 0.0])
    expected = [] if abs(off) < 1e-4 else ["Kawasaki"]
    named = [rule for _, rule in rules(star(bent, letters)) if rule == "Kawasaki"]
    assert named == expected


def test_each_rule_is_named_with_what_is_the_case():
    sectors = np.radians([60.0, 100.0, 120.0, 80.0])
    findings = {
        "MMMV": "big-little-big: a sector of 60.00 degrees, smaller than those beside it, lies "
        "between two mountains",
        "MVMV": "Maekawa: 2 mountains and 2 valleys, which are not two apart",
    }
    for letters, finding in findings.items():
        (broken,) = broken_rules(star(sectors, letters))
        assert f"{broken.rule}: {broken.finding}" == finding
    (broken,) = broken_rules(star(np.radians([61.0, 99.0, 120.0, 80.0]), "VMMM"))
    assert broken == (0, "Kawasaki", "alternate sectors add up to 181.00 degrees, not 180")
    (broken,) = broken_rules(star(np.radians([60.0, 100.0, 200.0]), "VMM"))
    assert broken == (0, "even degree", "3 creases meet, an odd number")


def test_what_nobody_has_assigned_is_judged_by_its_angles_alone():
    assert rules(star(np.radians([60.0, 100.0, 120.0, 80.0]), "MVMU")) == []
    assert rules(star(np.radians([61.0, 99.0, 120.0, 80.0]), "MVMU")) == [(0, "Kawasaki")]
    # Flat edges are no creases.
    assert rules(star(np.radians([60.0, 100.0, 80.0, 40.0, 80.0]), "VMMFM")) == []


def test_the_first_flat_frame_is_read_with_what_it_inherits(tmp_path):
    flat, up = [[0, 0], [2, 0], [2, 2], [0, 2]], [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 1]]
    frame = {"frame_inherit": True, "frame_parent": 0, "vertices_coords": flat}
    document = {
        "file_spec": 1.2,
        "vertices_coords": up,
        "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
        "edges_assignment": list("BBBBM"),
    }
    file = tmp_path / "sheet.fold"
    file.write_text(json.dumps(document | {"file_frames": [frame]}))
    pattern = read_pattern(file)
    assert pattern.vertices.tolist() == flat
    assert pattern.assignments == tuple("BBBBM")
    file.write_text(json.dumps(document))
    with pytest.raises(DesignError, match=r"sheet\.fold: must have a flat frame, with edges"):
        read_pattern(file)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"edges_vertices": [[0, 7]]}, "edges must have vertices 0 to 2 as ends; got 7"),
        ({"edges_vertices": [[1, 1]]}, "got one that begins where it ends"),
        ({"edges_assignment": ["X"]}, "assignments must be one of B, C, F, J, M, U, V"),
        ({"vertices_coords": [[0, float("nan")]]}, "rows of two or three finite numbers"),
        ({"vertices_coords": "here"}, "must be a FOLD document"),
        ({"edges_vertices": []}, "must have a flat frame"),
    ],
)
def test_documents_that_cannot_be_are_refused(tmp_path, change, message):
    document = {
        "vertices_coords": [[0, 0], [1, 0], [0, 1]],
        "edges_vertices": [[0, 1]],
        "edges_assignment": ["M"],
    }
    file = tmp_path / "bad.fold"
    file.write_text(json.dumps(document | change))
    with pytest.raises(DesignError, match=message):
        read_pattern(file)
    file.write_text("[" * 100_000)
    with pytest.raises(DesignError, match="must be a FOLD document"):
        read_pattern(file)
