"""The MLX90393 as an instrument: what a field becomes on its way through the chip.

Decides sensitivity, range, noise, loss of bits, temperature word and conversion time of a
setting; hides the arithmetic of the converter, of whose bits 16 are read. Fields are in
the chip's own axes; `rotation` leads from there to the skin's. Register HALLCONF is 0xC.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, Ints, floats
from smoskin.design.skin import HallSetting, HallSite
from smoskin.errors import ArgumentError
from smoskin.records import ChipFlag

REFERENCE_TEMPERATURE: Final = 25.0
"""degC: temperature of the data sheet's sensitivities and of the temperature word's offset."""

_STEP: Final = (0.150e-6, 0.150e-6, 0.242e-6)
"""T a count in x, y, z at GAIN_SEL 7 (1x) and RES 0."""
_GAIN: Final = (5.0, 4.0, 3.0, 2.5, 2.0, 5.0 / 3.0, 4.0 / 3.0, 1.0)
"""Factor on the step for GAIN_SEL 0..7."""
_RAIL: Final = 88_000
"""Counts of RES 0 from zero to where the converter stops: 22000 at RES 2, 11000 at RES 3."""
_TRUSTED: Final = 80_000
"""Counts of RES 0 that every converter reaches; some stop before the data sheet's end."""
_WORD: Final = 2**15
"""Counts from zero to the end of the 16 bits that are read."""
_DEGREE: Final = 45.2
"""Temperature counts a degree."""
_ROOM: Final = 46244
"""Temperature count at the reference temperature."""
_WAKING: Final = 0.68e-3
"""Time in which a single measurement wakes the chip and ends, s."""
_SLOWEST: Final = 1.1
"""Period of the slowest oscillator over the nominal one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HallNoise:
    """Noise of one conversion: white in the time of integration, plus a floor.

    The data sheet's plot of noise is not at hand, so the figures are assumptions: a reader of it
    quotes 10 mG, 1 uT, at 10 ms, where these defaults give 1.07 uT. Quiet stretches of a published
    recording (five chips, gain 2x, RES 3, filter unknown) show 2.3 uT in x and y and 3.8 in z,
    steps taken off. Measure your board.
    """

    white: tuple[float, float, float] = (4.0e-6, 4.0e-6, 6.5e-6)
    """T, standard deviation in x, y, z at GAIN_SEL 7, OSR 0 and DIG_FILT 0; it falls with the
    square root of the samples taken. z is noisier as its step is larger."""
    converter: float = 0.05
    """Share of the white variance at GAIN_SEL 7 that the converter makes: in counts the same at
    every gain, so that in tesla it grows with the step. Assumed."""
    floor: tuple[float, float, float] = (0.4e-6, 0.4e-6, 0.65e-6)
    """T, standard deviation that no averaging lowers."""
    temperature: float = 0.0
    """degC, standard deviation of the temperature reading. No figure is known: by default its
    steps of 0.022 degC are all there is."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.converter <= 1.0:
            raise ArgumentError(f"converter must lie in 0..1; got {self.converter}")
        if not 0.0 <= self.temperature < np.inf:
            raise ArgumentError(f"temperature must be >= 0 degC; got {self.temperature}")
        for name in ("white", "floor"):
            value = getattr(self, name)
            if len(value) != 3 or not all(0.0 <= sigma < np.inf for sigma in value):
                raise ArgumentError(f"{name} must be three numbers >= 0, in T; got {value}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HallSample:
    """Answers of chips."""

    counts: Ints
    """(..., 3): counts of x, y, z as signed 16-bit numbers."""
    temperature_counts: Ints
    """(...,): temperature word, unsigned 16 bits."""
    flags: Ints
    """(...,), `ChipFlag`: SATURATED at a rail, INVALID where there was no field. A wrapped axis
    looks valid to the chip and has no flag."""


def sensitivity(setting: HallSetting) -> Floats:
    """Tesla a count in x, y, z, shape (3,), by gain and resolution.

    Notes
    -----
    Source: Melexis MLX90393 data sheet, sensitivity table for HALLCONF 0xC, 25 degC. Valid to
    0.3 %, the rounding of that table; chips scatter by more, which calibration absorbs.

    Examples
    --------
    >>> setting = HallSetting(gain_selection=7, resolution=3, oversampling=0, digital_filter=2)
    >>> (sensitivity(setting) * 1e6).round(3)
    array([1.2  , 1.2  , 1.936])
    """
    return np.array(_STEP) * (_GAIN[setting.gain_selection] * 2.0**setting.resolution)


def full_scale(setting: HallSetting) -> Floats:
    """Field in x, y, z, T, beyond which to either side a reading wraps (`wraps`) or may stop, (3,).

    Notes
    -----
    Source: Melexis MLX90393 data sheet rev 011, Table 21: +-22000 counts at RES 2 and +-11000 at
    RES 3. The converter's nominal 17.4 bits end at 21619 and 10809, and a chip's may end earlier:
    a design should leave a tenth. The front end is specified to 50 mT only.

    Examples
    --------
    >>> setting = HallSetting(gain_selection=7, resolution=3, oversampling=0, digital_filter=2)
    >>> (full_scale(setting) * 1e3).round(1)
    array([13.2, 13.2, 21.3])
    """
    return sensitivity(setting) * min(_WORD, _RAIL >> setting.resolution)


def wraps(setting: HallSetting) -> bool:
    """Whether a field past the range comes back as a false value instead of stopping."""
    return _WORD << setting.resolution < _RAIL


def railed(counts: ArrayLike, setting: HallSetting) -> Bools:
    """Whether an axis of chips, by its signed counts (..., 3), may stand at its rail, (...,).

    At RES 0 and 1 none does: what is too much wraps. A real chip may stop a tenth before the data
    sheet's end; one that `measure` simulates stops there.
    """
    trusted = _TRUSTED >> setting.resolution
    beyond = (np.abs(np.asarray(counts)) >= trusted).any(axis=-1)
    return np.asarray(beyond & (not wraps(setting)))


def noise(setting: HallSetting, model: HallNoise | None = None) -> Floats:
    """Standard deviation of one conversion in x, y, z, T, before it is rounded to counts, (3,).

    Oversampling and filter set the samples taken, the gain how much the converter adds. The
    resolution adds its step's rounding only, which `measure` does.

    Examples
    --------
    >>> setting = HallSetting(gain_selection=7, resolution=0, oversampling=0, digital_filter=0)
    >>> (noise(setting) * 1e6).round(1)
    array([4. , 4. , 6.5])
    """
    law = model or HallNoise()
    longer = _samples(setting) / 3.0
    louder = 1.0 + law.converter * (_GAIN[setting.gain_selection] ** 2 - 1.0)
    return np.asarray(np.sqrt(np.square(law.white) * (louder / longer) + np.square(law.floor)))


def measure(
    field: ArrayLike,
    setting: HallSetting,
    temperature: ArrayLike = REFERENCE_TEMPERATURE,
    rng: np.random.Generator | None = None,
    model: HallNoise | None = None,
) -> HallSample:
    """One conversion of each chip; without a generator the chips are noiseless.

    The field, (..., 3), T, is in the chip's own axes; the chips' temperature, (...), degC, is
    broadcast against it. At RES 0 and 1 a field beyond +-32768 counts wraps to a false value
    without a flag; at RES 2 and 3 the converter stops at the end of its range (`full_scale`), and
    a reading that stands there is flagged; `railed` flags those of boards a tenth earlier. It
    raises an `ArgumentError` if `field` is not (..., 3).

    Notes
    -----
    Source: Melexis MLX90393 data sheet. Valid as `full_scale`.
    """
    true, law = floats("field", field, (3,)), model or HallNoise()
    finite = np.asarray(np.isfinite(true).all(axis=-1))
    seen = np.where(finite[..., None], true, 0.0)
    if rng is not None:
        seen = seen + rng.normal(size=seen.shape) * noise(setting, law)
    step = sensitivity(setting) / 2.0**setting.resolution
    full = np.rint(np.clip(seen / step, -_RAIL, _RAIL - 1)).astype(np.int64)
    counts = (((full >> setting.resolution) + _WORD) & 0xFFFF) - _WORD
    rail = _RAIL >> setting.resolution
    stopped = ((counts >= rail - 1) | (counts <= -rail)).any(axis=-1) & (not wraps(setting))
    flags = np.where(stopped, int(ChipFlag.SATURATED), int(ChipFlag.GOOD))
    flags = np.where(finite, flags, int(ChipFlag.INVALID))
    warmth = np.broadcast_to(floats("temperature", temperature), finite.shape)
    if rng is not None and law.temperature:
        warmth = warmth + rng.normal(size=warmth.shape) * law.temperature
    return HallSample(counts=counts, temperature_counts=temperature_counts(warmth), flags=flags)


def tesla(counts: ArrayLike, setting: HallSetting) -> Floats:
    """Field, T, in the chip's own axes, that signed counts (..., 3) stand for: their lower edge.

    Counts of another shape raise an `ArgumentError`.
    """
    return floats("counts", counts, (3,)) * sensitivity(setting)


def temperature_counts(temperature: ArrayLike) -> Ints:
    """Temperature word of a temperature in degC, clipped to 16 bits; zero for NaN.

    Notes
    -----
    Source: Melexis MLX90393 data sheet, 45.2 counts a degree, 46244 at 25 degC. Valid for
    -40 to 85 degC.

    Examples
    --------
    >>> int(temperature_counts(35.0))
    46696
    """
    word = _ROOM + _DEGREE * (floats("temperature", temperature) - REFERENCE_TEMPERATURE)
    return np.asarray(np.rint(np.clip(np.nan_to_num(word), 0, 0xFFFF)), dtype=np.int64)


def degrees(counts: ArrayLike) -> Floats:
    """Temperature in degC of a temperature word; the inverse of `temperature_counts`."""
    return np.asarray(REFERENCE_TEMPERATURE + (floats("counts", counts) - _ROOM) / _DEGREE)


def settles(setting: HallSetting) -> bool:
    """Whether the chip's filter has time enough for the hall plate at this setting.

    Notes
    -----
    Source: Melexis MLX90393 getting-started guide: at HALLCONF 0xC the pairs (OSR, DIG_FILT)
    (0, 0), (0, 1) and (1, 0) are not allowed. The chip takes them, and reads falsely.
    """
    return setting.oversampling + setting.digital_filter >= 2


def conversion_time(
    setting: HallSetting, temperature_oversampling: int | None = None, *, worst: bool = False
) -> float:
    """Time of one single measurement of x, y and z, from the command to the data, s.

    The temperature is measured too where its oversampling OSR2, 0..3, is given. `worst` is the
    slowest oscillator's. It raises an `ArgumentError` if OSR2 is not in 0..3.

    Notes
    -----
    Source: Melexis MLX90393 data sheet rev 011, Table 15: 220 us to stand by, 360 us to become
    active and 100 us to end, 67 us + 64 us 2^OSR (2 + 2^DIG_FILT) an axis and 67 us +
    192 us 2^OSR2 for the temperature. The oscillator is trimmed to 5 % and drifts by 5 %; the
    table's limits of starting and ending are 20 % wide.

    Examples
    --------
    >>> setting = HallSetting(gain_selection=7, resolution=0, oversampling=0, digital_filter=2)
    >>> [round(1e3 * conversion_time(setting, 0, worst=worst), 2) for worst in (False, True)]
    [2.29, 2.59]
    """
    measured = _measuring_time(setting, temperature_oversampling)
    if worst:
        return 1.2 * _WAKING + _SLOWEST * measured
    return _WAKING + measured


def burst_period(
    setting: HallSetting,
    temperature_oversampling: int | None = None,
    *,
    data_rate: int = 0,
    worst: bool = False,
) -> float:
    """Time from one measurement of x, y and z to the next in burst mode, s; else `conversion_time`.

    BURST_DATA_RATE, 0..63, adds 20 ms each; another one raises an `ArgumentError`. Chips run on
    oscillators of their own, up to 10 % apart.

    Notes
    -----
    Source: Melexis MLX90393 data sheet rev 011: Table 20 guarantees 493, 348 and 201 Hz at
    (OSR, DIG_FILT) of (0, 2), (0, 3) and (1, 3) with the temperature, which a tenth above the
    times of Table 19 gives; the pause comes on top of the measurement (footnote 5).

    Examples
    --------
    >>> setting = HallSetting(gain_selection=7, resolution=0, oversampling=0, digital_filter=2)
    >>> round(1 / burst_period(setting, 0, worst=True))
    493
    """
    if not 0 <= data_rate <= 63:
        raise ArgumentError(f"data_rate must lie in 0..63; got {data_rate}")
    period = _measuring_time(setting, temperature_oversampling) + 0.231e-3 + 20e-3 * data_rate
    return _SLOWEST * period if worst else period


def _measuring_time(setting: HallSetting, temperature_oversampling: int | None) -> float:
    """Time that the converter spends on x, y, z and, with its oversampling, the temperature, s."""
    axes = 3.0 * (67e-6 + 64e-6 * _samples(setting))
    if temperature_oversampling is None:
        return axes
    if not 0 <= temperature_oversampling <= 3:
        raise ArgumentError(
            f"temperature_oversampling must lie in 0..3; got {temperature_oversampling}"
        )
    return axes + 67e-6 + 192e-6 * float(2**temperature_oversampling)


def _samples(setting: HallSetting) -> float:
    """Integration periods of 64 us an axis."""
    return float(2**setting.oversampling * (2 + 2**setting.digital_filter))


def rotation(site: HallSite) -> Floats:
    """Rotation R from the chip's axes to the skin's, (3, 3): B_skin = R @ B_chip.

    Examples
    --------
    >>> site = HallSite(name="S1", magnet="M1", gap=5e-3, axes=("+x", "-y", "-z"), address=12)
    >>> rotation(site) @ [1.0, 2.0, 3.0]
    array([ 1., -2., -3.])
    """
    turned = np.zeros((3, 3))
    for column, axis in enumerate(site.axes):
        turned["xyz".index(axis[1]), column] = -1.0 if axis[0] == "-" else 1.0
    return turned


def rotations(sites: Sequence[HallSite]) -> Floats:
    """`rotation` of each site, shape (S, 3, 3)."""
    return np.stack([rotation(site) for site in sites])
