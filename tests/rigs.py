"""A stage and a gauge on pseudo-terminals, byte for byte, that press one spring."""

import threading
import time

import numpy as np

from boards import Line
from smoskin.hardware.rig.gauge import AsciiGauge
from smoskin.hardware.rig.press import PressRig
from smoskin.hardware.rig.stage import GrblStage
from smoskin.records import Contact, Reading
from smoskin.roles import Source

ORIGIN = np.array([-0.100, -0.080, -0.0113])
"""Place of the stage over the skin's origin, m."""
SURFACE = -0.0125
"""Height of the stage at which the probe meets the skin, m."""


class World:
    """Where the probe is and what it feels: a spring, which may lie on something hard."""

    def __init__(self, stiffness=1000.0, hard=np.inf):
        self.place = np.array([-0.020, -0.020, -0.001])
        self.stiffness, self.hard = stiffness, hard
        self.most = 0.0

    def force(self):
        depth = max(SURFACE - self.place[2], 0.0)
        return self.stiffness * depth + 1e5 * max(depth - self.hard, 0.0)

    def go(self, place):
        self.place = np.array(place)
        self.most = max(self.most, self.force())


class Instrument:
    """A thread at the far end of a pseudo-terminal."""

    def __init__(self, world):
        self.world, self.line = world, Line()
        self.silent = False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def port(self):
        return self.line.port

    def say(self, text):
        self.line.send(text.encode() + b"\r\n")

    def close(self):
        self._over.set()
        self._thread.join()
        self.line.hang_up()

    def _run(self):
        while not self._over.is_set():
            data = self.line.received()
            self.tick()
            if data and not self.silent:
                self.take(data)
            elif not data:
                time.sleep(0.0005)

    def tick(self):
        pass


class FakeStage(Instrument):
    """GRBL 1.1 as its documents tell: jogs, feed hold, cancel, resume, reset, status, alarms.

    A jog of less than 1 mm takes `share` of its true time; `alarm_below` is a limit switch.
    """

    def __init__(self, world, share=0.0, work=False):
        self.state, self.share, self.work = "Idle", share, work
        self.alarm_below = -np.inf
        self.asked, self.reports = [], 0
        self._text, self._jog, self._refuse = b"", None, None
        super().__init__(world)

    def refuse(self, code):
        self._refuse = code

    def tick(self):
        if self._jog is None:
            return
        start, end, begun, takes = self._jog
        part = 1.0 if takes <= 0 else min((time.monotonic() - begun) / takes, 1.0)
        self.world.go(start + part * (end - start))
        if self.world.place[2] < self.alarm_below:
            self.state, self._jog = "Alarm", None
            self.say("ALARM:1")
        elif part == 1.0:
            self.state, self._jog = "Idle", None

    def take(self, data):
        for byte in data:
            char = bytes([byte])
            if char == b"?":
                self.report()
            elif char == b"!":
                moving, self._jog = self._jog is not None, None
                if self.state != "Alarm":
                    self.state = "Idle" if moving else "Hold"
            elif char == b"\x85":
                if self._jog is not None:
                    self.state, self._jog = "Idle", None
            elif char == b"~":
                self.state = "Idle" if self.state == "Hold" else self.state
            elif char == b"\x18":
                self._jog, self.state = None, "Alarm" if self._jog else "Idle"
                self.say("Grbl 1.1h ['$' for help]")
            elif char == b"\n":
                self.obey(self._text.decode())
                self._text = b""
            else:
                self._text += char

    def report(self):
        x, y, z = 1e3 * self.world.place
        self.reports += 1
        state = "Hold:0" if self.state == "Hold" else self.state
        if self.work:
            offset = "|WCO:5.000,0.000,-1.000" if self.reports % 3 == 0 else "|Ov:100,100,100"
            self.say(f"<{state}|WPos:{x - 5:.3f},{y:.3f},{z + 1:.3f}|FS:0,0{offset}>")
        else:
            self.say(f"<{state}|MPos:{x:.3f},{y:.3f},{z:.3f}|Bf:15,127|FS:0,0>")

    def obey(self, text):
        self.asked.append(text)
        head, *words = text.split()
        assert (head, words[:2]) == ("$J=G53", ["G90", "G21"])
        if self.state not in ("Idle", "Jog"):
            self.say("error:9" if self.state == "Alarm" else "error:8")
        elif self._refuse is not None:
            self.say(f"error:{self._refuse}")
        else:
            target = {word[0]: float(word[1:]) for word in words[2:]}
            end = 1e-3 * np.array([target[axis] for axis in "XYZ"])
            way = np.linalg.norm(end - self.world.place)
            takes = way / (1e-3 * target["F"] / 60) * self.share if way < 1e-3 else 0.0
            self._jog = (self.world.place.copy(), end, time.monotonic(), takes)
            self.state = "Jog"
            self.say("ok")


class FakeGauge(Instrument):
    """A Mark-10 gauge; `form` writes what it feels, N."""

    def __init__(self, world, noise=0.0, form="{:.3f} N", zeroes=True):
        self.noise, self.form, self.zeroes = noise, form, zeroes
        self.drift, self.dies_above, self.zero = 0.0, np.inf, 0.031
        self._rng, self._text = np.random.default_rng(0), b""
        super().__init__(world)

    def take(self, data):
        *lines, self._text = (self._text + data).split(b"\n")
        for line in lines:
            match line.strip():
                case b"?":
                    force = self.world.force()
                    self.silent = self.silent or force > self.dies_above
                    if not self.silent:
                        felt = force + self.zero + self.drift * (self.world.most > 0)
                        self.say(self.form.format(felt + self.noise * self._rng.normal()))
                case b"Z" if self.zeroes:
                    self.zero = -self.world.force()
                case _:
                    self.say("*10")


class Skin(Source):
    """Two chips at 500 Hz, whose field is the force that presses; it may fall silent."""

    chips = 2

    def __init__(self, world):
        self.world, self.begun, self.ends_above = world, time.monotonic(), np.inf
        self._closed = threading.Event()

    def read(self, timeout=1.0):
        self._closed.wait(0.002)
        force = self.world.force()
        if self._closed.is_set() or force > self.ends_above:
            return None
        moment = time.monotonic() - self.begun
        return Reading(time=moment, field=np.full((2, 3), 1e-3 * force))

    def close(self):
        self._closed.set()


class Bench:
    """All of it, and a rig on it."""

    def __init__(self, world=None, noise=0.0, form="{:.3f} N", share=0.0, **options):
        self.world = World() if world is None else world
        self.stage = FakeStage(self.world, share)
        self.gauge = FakeGauge(self.world, noise, form)
        self.skin = Skin(self.world)
        self.rig = PressRig(
            self.skin,
            GrblStage(self.stage.port),
            AsciiGauge(self.gauge.port),
            **{"origin": ORIGIN, "stiffness": 2500.0, **options},
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.rig.close()
        self.stage.close()
        self.gauge.close()

    @property
    def lifted(self):
        return abs(self.world.place[2] - ORIGIN[2]) < 1e-9


def straight(force, place=(0.01, 0.02)):
    return Contact(position=place, force=(0.0, 0.0, -force))
