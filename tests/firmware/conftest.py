"""Three chips of the planar design on a bus, on a clock of their own."""

import pytest

from chip_fake import Clock, FakeBus, FakeChip


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def bus(clock: Clock) -> FakeBus:
    return FakeBus(clock, {0x0C + k: FakeChip(clock) for k in range(3)})
