"""Messages for viewers of other tools."""

import struct

import numpy as np
import pytest

from smoskin.records import ChipFlag, Reading

pytest.importorskip("rosbags")

from smoskin.service.ros import Codec

TELLS_NOTHING = {ChipFlag.MISSING, ChipFlag.WRAPPED, ChipFlag.INVALID}


@pytest.mark.parametrize("flag", list(ChipFlag))
def test_viewers_get_no_field_of_a_chip_whose_numbers_mean_nothing(flag):
    field = np.array([[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]])
    reading = Reading(time=1.0, field=field, flags=[0, int(flag)])
    codec = Codec()
    for chip in range(2):
        message = codec.encode_field(reading, chip, 10**9)
        # sensor_msgs/MagneticField: a header, the field's three doubles, nine of its covariance.
        seen = struct.unpack("<3d", message[-12 * 8 : -9 * 8])
        meaningless = chip == 1 and flag in TELLS_NOTHING
        np.testing.assert_array_equal(seen, np.full(3, np.nan) if meaningless else field[chip])
