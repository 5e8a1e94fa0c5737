"""A serial force gauge on a pseudo-terminal: units, zero, and answers that are no force."""

import pytest

from rigs import SURFACE, FakeGauge, World
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.rig.gauge import newtons, open_gauge

pytest.importorskip("serial")


@pytest.mark.parametrize(
    ("line", "force"),
    [
        ("4.285 N", 4.285),
        ("-18.780 N", -18.78),
        ("512 mN", 0.512),
        ("+50.99 gF", 0.50003),
        ("0.05099 kgF", 0.50004),
        ("0.1124 lbF", 0.49998),
        ("1.798 ozF", 0.49988),
        ("0.500N", 0.5),
    ],
)
def test_every_unit_of_force_is_newtons(line, force) -> None:
    assert newtons(line) == pytest.approx(force, rel=1e-4)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("4.285", "must tell its unit"),
        ("4.285 lbin", "must tell its unit"),
        ("0.11 lbF", "in steps of 44.5 mN"),
        ("1 N", "in steps of 1e\\+03 mN"),
        ("*10", "is no reading"),
        ("nan N", "is no reading"),
        ("1e3 N", "must tell its unit|is no reading"),
        ("4.2.8 N", "is no reading"),
        ("4,285 N", "is no reading"),
    ],
)
def test_what_is_no_fine_force_is_refused(line, message) -> None:
    with pytest.raises(SourceError, match=message):
        newtons(line)


@pytest.mark.parametrize("zeroes", [True, False])
@pytest.mark.parametrize("sign", ["positive", "negative"])
def test_a_tared_gauge_feels_what_has_come_since(zeroes, sign) -> None:
    world = World()
    fake = FakeGauge(world, zeroes=zeroes)
    try:
        with open_gauge(f"serial://{fake.port}?pressing={sign}") as gauge:
            gauge.tare()
            assert gauge.force() == pytest.approx(0.0, abs=1e-3)
            world.go((0.0, 0.0, SURFACE - 0.5e-3))
            expected = 0.5 if sign == "positive" else -0.5
            assert gauge.force() == pytest.approx(expected, abs=2e-3)
    finally:
        fake.close()


def test_a_gauge_that_trembles_or_falls_silent_is_told() -> None:
    fake = FakeGauge(World(), noise=0.05)
    try:
        with open_gauge(f"serial://{fake.port}") as gauge:
            with pytest.raises(SourceError, match=r"while nothing touches: let it come to rest"):
                gauge.tare()
            fake.silent = True
            with pytest.raises(SourceError, match=r"gauge on .* has not answered within 1 s"):
                gauge.force()
    finally:
        fake.close()


def test_a_gauge_without_a_unit_is_refused_at_once() -> None:
    fake = FakeGauge(World(), form="{:.3f}")
    try:
        with pytest.raises(SourceError, match=r"must tell its unit, one of N, mN"):
            open_gauge(f"serial://{fake.port}")
    finally:
        fake.close()


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("serial:///dev/x?pressing=down", "pressing must be positive or negative"),
        ("serial:///dev/x?unit=N", "gauge must be serial://PORT, with the options baud, pressing"),
        ("serial:///dev/x?baud=1", "baud of the gauge must be"),
    ],
)
def test_urls_of_no_gauge_are_refused(url, message) -> None:
    with pytest.raises(ArgumentError, match=message):
        open_gauge(url)
