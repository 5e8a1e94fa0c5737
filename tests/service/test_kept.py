"""A rig that remembers its touches: what it presses, and the files that it keeps."""

import numpy as np

from smoskin.design.document import read_design
from smoskin.measurement import read_touches
from smoskin.records import Contact, Reading
from smoskin.roles import HeldTouch, Rig
from smoskin.service.kept import RememberingRig
from smoskin.service.recording import open_recording

DESIGN = read_design("planar")


class Arm(Rig):
    """Holds every touch for a second, after a second of rest."""

    place_spread, force_spread = 3e-5, 4e-3

    def __init__(self):
        self.asked, self.closed = [], False

    def press(self, contact, timeout=30.0):
        begin = 10.0 * len(self.asked)
        self.asked.append(timeout)
        readings = [
            Reading(time=begin + k, field=np.full((3, 3), 1e-6 * (begin + k))) for k in range(4)
        ]
        rest, held = (begin, begin + 1), (begin + 2, begin + 3)
        return HeldTouch(contact=contact, readings=readings, rest=rest, held=held)

    def close(self):
        self.closed = True


def contact(x):
    return Contact(position=(x, 0.05), force=(0.1, 0.0, -0.4))


def test_it_presses_as_its_rig_and_leaves_that_open():
    arm = Arm()
    with RememberingRig(arm, DESIGN) as rig:
        assert (rig.place_spread, rig.force_spread) == (3e-5, 4e-3)
        first, second = rig.press(contact(0.03)), rig.press(contact(0.04), 5.0)
    assert arm.asked == [30.0, 5.0]
    assert first.contact.position[0] == 0.03
    assert second.contact.position[0] == 0.04
    assert not arm.closed


def test_touches_are_kept_under_names_that_are_free(tmp_path):
    rig = RememberingRig(Arm(), DESIGN)
    assert rig.keep(tmp_path / "own.table") == "no touch was made"
    for x in (0.03, 0.04):
        rig.press(contact(x))
    (tmp_path / "own.touches2.mcap").touch()
    (tmp_path / "own.touches4.csv").touch()
    names = []
    for _ in range(3):
        names.append(rig.keep(tmp_path / "own.table").removeprefix("the touches are kept: "))
    stems = [tmp_path / f"own.touches{number}" for number in ("", "3", "5")]
    assert names == [f"--sheet {stem}.csv --recording {stem}.mcap" for stem in stems]
    recording = open_recording(f"{stems[0]}.mcap")
    assert [reading.time for reading in recording.readings()] == [0, 1, 2, 3, 10, 11, 12, 13]
    table = read_touches(f"{stems[0]}.csv")[0]
    # Rest and hold of every touch, a row each.
    np.testing.assert_array_equal(table.held, [[0, 1], [2, 3], [10, 11], [12, 13]])
    np.testing.assert_array_equal(table.touched, [False, True, False, True])
    np.testing.assert_allclose(table.position[1::2], [[0.03, 0.05], [0.04, 0.05]])
    np.testing.assert_allclose(table.force[1::2], np.tile([0.1, 0.0, -0.4], (2, 1)))
    assert not table.force[::2].any()
    assert np.isnan(table.field).all() or not table.field.size
