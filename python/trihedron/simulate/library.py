"""Ready-made scenarios by name."""

from __future__ import annotations

from collections.abc import Callable

from trihedron.simulate.noise import NoiseTerms
from trihedron.simulate.scenario import Clock, Environment, Scenario
from trihedron.simulate.sensors import Accelerometer, Adc, Gyroscope
from trihedron.simulate.sessions import dividing_head, hand_session, long_rest, six_faces, table_turns
from trihedron.units import AccelerationUnit, RateUnit

# Consumer 16-bit part: ±2 g at 16384 LSB/g, ±250 deg/s at 131 LSB/(deg/s), densities 400 µg/√Hz and 0.005 deg/s/√Hz.
_LSB_M_S2 = 9.80665 / 16384.0
_LSB_RAD_S = 1.3323e-4

_MPU_ACCELEROMETER = Accelerometer(
    S=(
        (_LSB_M_S2 * 1.004, 0.0, 0.0),
        (_LSB_M_S2 * 0.003, _LSB_M_S2 * 0.996, 0.0),
        (-_LSB_M_S2 * 0.005, _LSB_M_S2 * 0.004, _LSB_M_S2 * 1.012),
    ),
    b=(0.35, -0.21, 0.62),
    unit=AccelerationUnit.COUNTS,
    noise=NoiseTerms(N=(3.9e-3, 3.9e-3, 3.9e-3), K=(2e-5, 2e-5, 2e-5)),
    adc=Adc(1.0, -32768.0, 32767.0),
)
_MPU_GYROSCOPE = Gyroscope(
    S=(
        (_LSB_RAD_S * 1.011, _LSB_RAD_S * 0.006, -_LSB_RAD_S * 0.004),
        (_LSB_RAD_S * 0.008, _LSB_RAD_S * 0.992, _LSB_RAD_S * 0.003),
        (-_LSB_RAD_S * 0.005, _LSB_RAD_S * 0.007, _LSB_RAD_S * 1.006),
    ),
    b=(0.021, -0.034, 0.012),
    unit=RateUnit.COUNTS,
    noise=NoiseTerms(N=(8.7e-5, 8.7e-5, 8.7e-5), K=(2e-6, 2e-6, 2e-6)),
    adc=Adc(1.0, -32768.0, 32767.0),
)


def _hand_session() -> Scenario:
    """24 poses by hand, MPU-class."""
    return Scenario(hand_session(), "hand-session", _MPU_ACCELEROMETER, _MPU_GYROSCOPE, Clock(100.0))


def _linear() -> Scenario:
    """The same without noise and without a converter: what a perfect estimator inverts exactly."""
    accel = Accelerometer(_MPU_ACCELEROMETER.S, _MPU_ACCELEROMETER.b, AccelerationUnit.COUNTS)
    gyro = Gyroscope(_MPU_GYROSCOPE.S, _MPU_GYROSCOPE.b, RateUnit.COUNTS)
    return Scenario(hand_session(), "linear-noiseless", accel, gyro, Clock(100.0), Environment())


def _six_faces() -> Scenario:
    """Six faces, twice round, MPU-class."""
    return Scenario(six_faces(2), "six-faces", _MPU_ACCELEROMETER, _MPU_GYROSCOPE)


def _table_turns() -> Scenario:
    """Turns of multiples of 90 deg on three faces, MPU-class."""
    return Scenario(table_turns(), "table-turns", _MPU_ACCELEROMETER, _MPU_GYROSCOPE)


def _rest() -> Scenario:
    """One hour at rest, MPU-class."""
    return Scenario(long_rest(3600.0), "rest-hour", _MPU_ACCELEROMETER, _MPU_GYROSCOPE)


def _dividing_head() -> Scenario:
    """324 poses of an optical dividing head, MPU-class."""
    return Scenario(dividing_head(), "dividing-head", _MPU_ACCELEROMETER, _MPU_GYROSCOPE)


_SCENARIOS: dict[str, Callable[[], Scenario]] = {
    "hand-session": _hand_session,
    "linear-noiseless": _linear,
    "six-faces": _six_faces,
    "table-turns": _table_turns,
    "rest-hour": _rest,
    "dividing-head": _dividing_head,
}


def list_scenarios() -> dict[str, str]:
    """Name and one sentence for each ready-made scenario."""
    return {name: (make.__doc__ or "").strip() for name, make in _SCENARIOS.items()}


def scenario_by_name(name: str) -> Scenario:
    """A ready-made scenario.

    Raises
    ------
    ValueError
        When there is none of that name.
    """
    if name not in _SCENARIOS:
        raise ValueError(f"no scenario is called {name!r}; there are {', '.join(_SCENARIOS)}")
    return _SCENARIOS[name]()
