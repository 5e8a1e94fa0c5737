"""A UR controller as its network shows it: real-time data exchange, dashboard and script port.

Bytes are those of RTDE protocol 2, so that clients by others connect; the program that a client
sends is not run but known by what its registers ask of it. Joints take speeds at a bounded
acceleration; a watchdog that hears nothing ends the program, and joints slow down. It is a process
of its own, as `ur_rtde` lets no other thread run while it waits.
"""

import itertools
import multiprocessing
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

FORMATS = {
    "DOUBLE": "d", "VECTOR3D": "3d", "VECTOR6D": "6d", "INT32": "i", "UINT32": "I", "UINT64": "Q",
    "VECTOR6INT32": "6i", "UINT8": "B", "BOOL": "?",
}  # fmt: skip
KINDS = {
    "actual_q": "VECTOR6D", "actual_qd": "VECTOR6D", "robot_mode": "INT32", "safety_mode": "INT32",
    "runtime_state": "UINT32", "robot_status_bits": "UINT32", "safety_status_bits": "UINT32",
    "external_force_torque": "VECTOR6D",
}  # fmt: skip
VERSION, MESSAGE, DATA, CONTROLLER, OUTPUTS, INPUTS, PAUSE, START = 86, 77, 85, 118, 79, 73, 80, 83
DASHBOARD = {
    "PolyscopeVersion": "URSoftware 5.11.0.108249",
    "get serial number": "20195501234",
    "robotmode": "Robotmode: RUNNING",
    "safetystatus": "Safetystatus: NORMAL",
}
SPEED, SPEED_STOP, WATCHDOG, END = 9, 15, 35, 255
"""Commands in the first integer register."""
CYCLE = 0.002
_HOSTS = itertools.count(80)


def kind_of(name: str) -> str:
    if name in KINDS:
        return KINDS[name]
    return "INT32" if "_int_register_" in name else "DOUBLE"


class Controller:
    """A controller with six joints at a loopback address of its own."""

    def __init__(self, host: str) -> None:
        self.host = host
        self.remote = True
        self.angles, self.speeds = np.zeros(6), np.zeros(6)
        self.robot_mode, self.safety_mode = 7, 1
        self.frozen = False
        """Whether it tells nothing any more."""
        self.running = False
        self.history: list[tuple[float, np.ndarray]] = []
        """Times, s, of a monotonic clock, and speeds."""
        self.watched: float | None = None
        self._target, self._acceleration = np.zeros(6), 1.0
        self._ready, self._heard = 1, 0.0
        self._closed = threading.Event()
        self._sockets: list[socket.socket] = []
        ports = {30004: self._exchange, 29999: self._dashboard, 30002: self._script}
        for port, serve in {**ports, 30003: self._script, 30001: self._script}.items():
            self._listen(port, serve)
        threading.Thread(target=self._turn, daemon=True).start()

    def close(self) -> None:
        self._closed.set()
        for each in self._sockets:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _listen(self, port: int, serve: Callable[[socket.socket], None]) -> None:
        listening = socket.socket()
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((self.host, port))
        listening.listen()
        self._sockets.append(listening)

        def accept() -> None:
            while not self._closed.is_set():
                try:
                    client, _ = listening.accept()
                except OSError:
                    return
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets.append(client)
                threading.Thread(target=quietly, args=(client,), daemon=True).start()

        def quietly(client: socket.socket) -> None:
            with suppress(OSError, EOFError), client:
                serve(client)

        threading.Thread(target=accept, daemon=True).start()

    def _turn(self) -> None:
        """Joints and watchdog, 500 times a second."""
        before = time.monotonic()
        while not self._closed.wait(CYCLE):
            now = time.monotonic()
            if self.watched and self.running and now - self._heard > 1 / self.watched:
                self.end_program()
            most = self._acceleration * (now - before)
            self.speeds = self.speeds + np.clip(self._target - self.speeds, -most, most)
            self.angles = self.angles + (now - before) * self.speeds
            self.history.append((now, self.speeds))
            before = now

    def end_program(self) -> None:
        """The arm slows down, as a program's end has it do."""
        self.running, self._target, self._acceleration = False, np.zeros(6), 20.0

    def _exchange(self, client: socket.socket) -> None:
        outputs: dict[int, list[str]] = {}
        inputs: dict[int, list[str]] = {}
        lock, started = threading.Lock(), threading.Event()

        def send(kind: int, payload: bytes) -> None:
            with lock:
                client.sendall(struct.pack(">HB", 3 + len(payload), kind) + payload)

        def tell() -> None:
            with suppress(OSError):
                while not self._closed.wait(CYCLE):
                    if started.is_set() and not self.frozen:
                        for recipe, names in outputs.items():
                            send(DATA, bytes([recipe]) + b"".join(map(self._packed, names)))

        threading.Thread(target=tell, daemon=True).start()
        while True:
            size, kind = struct.unpack(">HB", _exactly(client, 3))
            payload = _exactly(client, size - 3)
            if kind == VERSION:
                send(kind, bytes([payload == b"\0\2"]))
            elif kind == CONTROLLER:
                send(kind, struct.pack(">4I", 5, 11, 0, 108249))
            elif kind in (OUTPUTS, INPUTS):
                recipes = outputs if kind == OUTPUTS else inputs
                text = payload[8:] if kind == OUTPUTS else payload
                names = text.decode().strip(",").split(",")
                recipes[len(recipes) + 1] = names
                send(kind, bytes([len(recipes)]) + ",".join(map(kind_of, names)).encode())
            elif kind in (START, PAUSE):
                (started.set if kind == START else started.clear)()
                send(kind, b"\1")
            elif kind == DATA:
                names = inputs[payload[0]]
                layout = ">" + "".join(FORMATS[kind_of(name)] for name in names)
                self._asked(dict(zip(names, struct.unpack(layout, payload[1:]), strict=True)))

    def _packed(self, name: str) -> bytes:
        values = {
            "timestamp": time.monotonic(), "actual_q": self.angles, "actual_qd": self.speeds,
            "robot_mode": self.robot_mode, "safety_mode": self.safety_mode,
            "runtime_state": 2 if self.running else 1,
            "robot_status_bits": 3 if self.running else 1,
            "output_int_register_0": self._ready,
        }  # fmt: skip
        return struct.pack(">" + FORMATS[kind_of(name)], *np.atleast_1d(values.get(name, 0)))

    def _asked(self, registers: dict[str, float]) -> None:
        """What the program on the robot does of its input registers."""
        if "input_int_register_0" not in registers:
            return
        self._heard = time.monotonic()
        command = registers["input_int_register_0"]
        numbers = [value for name, value in registers.items() if "_double_" in name]
        # Speeds are taken in passing; other commands wait for the register to be cleared.
        self._ready = 1 if command in (0, SPEED) else 2
        if not self.running:
            return
        if command == SPEED:
            self._target, self._acceleration = np.array(numbers[:6]), numbers[6]
        elif command == SPEED_STOP:
            self._target, self._acceleration = np.zeros(6), numbers[0]
        elif command == WATCHDOG:
            self.watched = numbers[0]
        elif command == END:
            self.end_program()

    def _dashboard(self, client: socket.socket) -> None:
        client.sendall(b"Connected: Universal Robots Dashboard Server\n")
        answers = DASHBOARD | {"is in remote control": str(self.remote).lower()}
        while text := client.recv(4096):
            for line in text.decode().splitlines():
                client.sendall(answers.get(line.strip(), "ok").encode() + b"\n")

    def _script(self, client: socket.socket) -> None:
        text = b""
        while part := client.recv(1 << 16):
            text += part
            if text.rstrip().endswith(b"end"):
                text, self.running, self._ready = b"", True, 1
                self.watched = None


def _exactly(client: socket.socket, count: int) -> bytes:
    got = b""
    while len(got) < count:
        part = client.recv(count - len(got))
        if not part:
            raise EOFError
        got += part
    return got


class Robot:
    """A controller in another process: what it is asked, and what is changed of it."""

    def __init__(self) -> None:
        self.host = f"127.0.0.{next(_HOSTS)}"
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(self.host, other), daemon=True)
        self._process.start()
        self._pipe.recv()

    def get(self, name: str) -> Any:
        """A value of the controller's."""
        self._pipe.send((name, ()))
        assert self._pipe.poll(10.0)
        return self._pipe.recv()

    def set(self, **values: object) -> None:
        """Change values of the controller's."""
        for name, value in values.items():
            self._pipe.send((name, (value,)))
            assert self._pipe.poll(10.0)
            self._pipe.recv()

    def close(self) -> None:
        self._process.kill()
        self._process.join()


def _serve(host: str, pipe: Connection) -> None:
    controller = Controller(host)
    pipe.send(None)
    with suppress(EOFError):
        while True:
            name, values = pipe.recv()
            for value in values:
                setattr(controller, name, value)
            pipe.send(None if values else getattr(controller, name))


@contextmanager
def robot() -> Iterator[Robot]:
    made = Robot()
    try:
        yield made
    finally:
        made.close()
