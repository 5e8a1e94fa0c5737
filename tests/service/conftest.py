"""A recording that the tests of the service read."""

from pathlib import Path

import pytest

from touch_recordings import record


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Six moments, a chunk for each."""
    return record(tmp_path / "touch.mcap", 6)
