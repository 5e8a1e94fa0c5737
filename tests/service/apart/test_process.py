"""An object in a process of its own: what is told there, called here, and what goes wrong."""

import logging
import os
import threading
import time

import pytest

from diary import Diary
from smoskin.errors import SmoskinError
from smoskin.service.apart import process
from smoskin.service.apart.process import Remote


def wait_until(happened, seconds=20.0):
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_an_object_elsewhere_is_called_calls_back_and_takes_no_priority(caplog):
    heard, closed = [], []
    remote = Remote(
        Diary, "Ada", attributes=("process",), every=0.02, on_word=heard.append,
        on_close=closed.extend,
    )  # fmt: skip
    number, nice, policy = remote.values["process"]
    assert number != os.getpid()
    assert (nice, policy) == (os.nice(0), os.SCHED_OTHER)
    remote.tell("write", "first", slowly=0.5)
    wait_until(lambda: heard == ["first"])
    # Whoever tells never waits; the newest word is heard, and those before it forgotten.
    begun = time.monotonic()
    for word in range(1000):
        remote.tell("write", word)
    assert time.monotonic() - begun < 0.4
    with caplog.at_level(logging.WARNING, logger="smoskin"):
        remote.tell("warn", "The diary")
        wait_until(lambda: caplog.messages == ["The diary said so"])
    remote.tell("fail")
    wait_until(lambda: remote._failure is not None)
    with pytest.raises(KeyError, match="no such page"):
        remote.tell("write", "lost")
    remote.tell("write", "last")
    remote.close()
    remote.close()
    assert heard[-2:] == [999, "last"]
    assert len(heard) < 100
    assert closed == ["Ada", *heard]
    assert remote._process.returncode == 0
    assert not any("Diary" in thread.name for thread in threading.enumerate())


def test_what_making_raises_is_raised_here():
    with pytest.raises(ValueError, match="owner must have a name; got none"):
        Remote(Diary, "")


def test_a_callback_that_raises_and_a_process_that_is_gone_are_told():
    def refuse(word):
        raise RuntimeError(f"{word} is refused")

    remote = Remote(Diary, "Ada", on_word=refuse)
    remote.tell("write", "this")
    wait_until(lambda: remote._failure is not None)
    with pytest.raises(RuntimeError, match="this is refused"):
        remote.tell("write", "that")
    remote.tell("vanish")
    wait_until(lambda: remote._failure is not None)
    with pytest.raises(SmoskinError, match="the process of Diary has ended"):
        remote.close()


def test_a_process_that_does_not_end_is_ended(monkeypatch):
    monkeypatch.setattr(process, "_CLOSE_DEADLINE", 0.3)
    remote = Remote(Diary, "Ada", stubborn=True)
    with pytest.raises(SmoskinError, match=r"Diary has not ended within 0.3 s"):
        remote.close()
    assert remote._process.returncode < 0
