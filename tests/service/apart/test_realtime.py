"""A live program runs before others where the system lets it, and searches no old garbage."""

import gc
import os
import threading

import pytest

from smoskin.errors import ArgumentError
from smoskin.service.apart.realtime import undisturbed


def test_all_threads_run_first_and_old_objects_are_not_searched(monkeypatch):
    scheduled = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: scheduled.append(given))
    stop = threading.Event()
    other = threading.Thread(target=stop.wait)
    other.start()
    with undisturbed(realtime=True):
        assert gc.get_freeze_count() > 0
        here = {os.getpid(), other.native_id}
        assert here <= {thread for thread, policy, _ in scheduled if policy == os.SCHED_FIFO}
        scheduled.clear()
    assert here <= {thread for thread, policy, _ in scheduled if policy == os.SCHED_OTHER}
    assert gc.get_freeze_count() == 0
    stop.set()
    other.join()
    scheduled.clear()
    with undisturbed():
        assert gc.get_freeze_count() > 0
    assert scheduled == []


def test_a_system_that_does_not_let_it_is_told(monkeypatch):
    def refuse(*given):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(ArgumentError, match="realtime needs leave of the system: root, or rtprio"):
        undisturbed(realtime=True).__enter__()
    assert gc.get_freeze_count() == 0
