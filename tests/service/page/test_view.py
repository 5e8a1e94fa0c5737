"""The live page as a sink: what it refuses, that it never waits, and how it ends."""

import socket
import threading
import time
from urllib.parse import urlsplit

import numpy as np
import pytest

from pages import NOTHING, PLANAR, SHEET, TOUCH, assert_gone, reading
from smoskin.errors import ArgumentError
from smoskin.records import Reading
from smoskin.roles import Source
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.service.loop import Loop
from smoskin.service.page.view import View


def test_wrong_moments_are_refused() -> None:
    with View(PLANAR) as view:
        with pytest.raises(ArgumentError, match="reading must have 3 chips; got 2"):
            view.write(Reading(time=0.0, field=np.zeros((2, 3))), NOTHING)
        with pytest.raises(ArgumentError, match=r"vertices must have shape \(\.\.\., 169, 3\)"):
            view.write(reading(), NOTHING, vertices=np.zeros((4, 3)))


def test_a_port_in_use_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ArgumentError, match=f"port must be free; got {port}"):
            View(PLANAR, port=port)


def test_the_page_is_on_this_machine_only() -> None:
    with View(PLANAR) as view:
        address = urlsplit(view.url)
        assert address.hostname == "127.0.0.1"
        assert address.query.startswith("token=")
        with pytest.raises(OSError, match=r".*"):
            socket.create_connection(("127.0.0.2", address.port), timeout=1.0)


def test_closing_twice_leaves_no_thread_and_no_output(capsys: pytest.CaptureFixture[str]) -> None:
    before = set(threading.enumerate())
    with View(PLANAR) as view:
        view.write(reading(), NOTHING)
    view.close()
    assert_gone(before)
    assert capsys.readouterr().out == ""


def test_writing_never_waits() -> None:
    with View(PLANAR) as view:
        spans = []
        for number in range(200):
            begin = time.perf_counter()
            view.write(reading(number * 1e-3), NOTHING, truth=[TOUCH], vertices=SHEET.vertices)
            spans.append(time.perf_counter() - begin)
        assert float(np.median(spans)) < 1e-3


def test_a_view_is_a_sink_of_the_loop_and_counts_what_it_passes_over() -> None:
    """Four readings that come while the page draws nothing yet: the newest wins."""

    class Four(Source):
        chips = 3
        times = iter(range(4))

        def read(self, timeout: float = 1.0) -> Reading | None:
            time = next(self.times, None)
            return None if time is None else reading(0.01 * time)

        def close(self) -> None:
            """Hold nothing."""

    view = View(PLANAR)
    view._closing.set()  # its thread draws no more
    view._thread.join(10.0)
    loop = Loop(Four(), ZeroFirst(ClosedFormEstimator(PLANAR)), sinks=[view])
    assert len(list(loop)) == 4
    assert loop.counters.dropped == view.dropped == 3
    assert not view.watched
    view._server.stop()
