"""Classes of IMUs with typical data sheet figures, and units drawn within their tolerances.

Figures are written in the units of the data sheet and converted to SI here.
"""

from dataclasses import dataclass, replace

import numpy as np

from trihedron.errors import InputError
from trihedron.sanitise import meant
from trihedron.simulate.accelerometer import Accelerometer, ProofMass
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.noise import NoiseTerms, stream
from trihedron.simulate.readout import Adc, Matrix, Triple, matrix3, triple
from trihedron.simulate.scenario import Clock
from trihedron.units import STANDARD_GRAVITY_M_S2, AccelerationUnit, RateUnit, radians_from_degrees

_MG = STANDARD_GRAVITY_M_S2 / 1000.0
_DEG = radians_from_degrees(1.0)
# m/s/√h and °/√h to values per √s; °/h to rad/s.
_PER_ROOT_HOUR = 1.0 / 60.0
_DEG_PER_HOUR = _DEG / 3600.0


@dataclass(frozen=True)
class Profile:
    """A class of IMU: its nominal sensors and the tolerances of a unit.

    ``scale`` and ``misalignment`` are fractions (3σ), ``bias`` is in SI (3σ); each for accelerometer, then gyro.
    """

    name: str
    accelerometer: Accelerometer
    gyroscope: Gyroscope
    clock: Clock
    scale: tuple[float, float] = (0.0, 0.0)
    misalignment: tuple[float, float] = (0.0, 0.0)
    bias: tuple[float, float] = (0.0, 0.0)

    def unit(self, number: int) -> tuple[Accelerometer, Gyroscope]:
        """One produced unit: S and b drawn within the tolerances from the random stream of ``number``.

        The accelerometer's S is lower-triangular and defines the body frame; the gyro has all six cross-axis errors.
        """
        rng = stream(number, f"unit/{self.name}")
        out: list[tuple[Matrix, Triple]] = []
        sensors: tuple[Accelerometer | Gyroscope, ...] = (self.accelerometer, self.gyroscope)
        for k, sensor in enumerate(sensors):
            error = np.diag(self.scale[k] / 3.0 * rng.standard_normal(3))
            cross = self.misalignment[k] / 3.0 * rng.standard_normal((3, 3))
            error = error + (np.tril(cross, -1) if k == 0 else cross - np.diag(np.diag(cross)))
            S = (np.eye(3) + error) @ np.asarray(sensor.S)
            b = np.asarray(sensor.b) + self.bias[k] / 3.0 * rng.standard_normal(3)
            out.append((matrix3(S), triple(b)))
        accel = replace(self.accelerometer, S=out[0][0], b=out[0][1])
        gyro = replace(self.gyroscope, S=out[1][0], b=out[1][1])
        return accel, gyro


def _diagonal(value: float) -> Matrix:
    return matrix3(value * np.eye(3))


# SparkFun 6DOF with a 10-bit ADC at 3.3 V: Freescale MMA7260Q (800 mV/g at ±1.5 g, 350 µg/√Hz, one pole at
# 350 Hz) and InvenSense IDG-300 (2 mV/(°/s), ±500 °/s, 0.014 °/s/√Hz, 140 Hz); ratiometric to the board's supply.
# Matrices: the published example of the laboratory manual. It gives S_ω in rad/s per count and offsets in counts
# (457.68 counts are 1.48 V, the IDG-300's zero-rate level is 1.5 V), so b_ω = -S_ω·offset here.
_MANUAL_S_F: Matrix = ((-0.0393, 0.0, 0.0), (0.0001, 0.0390, 0.0), (0.0001, 0.0002, 0.0385))
_MANUAL_B_F: Triple = (19.5696, -22.4746, -20.3088)
_MANUAL_S_W: Matrix = ((-0.0290, 0.0002, 0.0002), (0.0021, 0.0251, -0.0022), (0.0004, -0.0005, 0.0285))
_MANUAL_OFFSET_COUNTS: Triple = (457.6807, 400.5889, 447.4656)
_b_w = -np.asarray(_MANUAL_S_W) @ np.asarray(_MANUAL_OFFSET_COUNTS)

ANALOG_6DOF = Profile(
    name="analog-6dof",
    accelerometer=Accelerometer(
        S=_MANUAL_S_F,
        b=_MANUAL_B_F,
        unit=AccelerationUnit.COUNTS,
        noise=NoiseTerms(N=triple(0.35 * _MG), B=triple(0.3 * _MG), K=triple(2e-5)),
        adc=Adc(1.0, 0.0, 1023.0),
    ),
    gyroscope=Gyroscope(
        S=_MANUAL_S_W,
        b=triple(_b_w),
        unit=RateUnit.COUNTS,
        noise=NoiseTerms(N=triple(0.014 * _DEG), B=triple(0.01 * _DEG), K=triple(2e-5)),
        adc=Adc(1.0, 0.0, 1023.0),
    ),
    clock=Clock(50.0),
    scale=(0.075, 0.1),
    misalignment=(0.03, 0.04),
    bias=(0.15 * STANDARD_GRAVITY_M_S2, 20.0 * _DEG),
)

# InvenSense MPU-6050/9150: accelerometer 16384 LSB/g ±3 %, cross-axis ±2 %, ±50/80 mg, 400 µg/√Hz; gyro
# 131 LSB/(°/s) ±3 %, cross-axis ±2 %, ±20 °/s, 0.005 °/s/√Hz. Bias instability and random walk: measured on such parts.
MPU = Profile(
    name="mpu",
    accelerometer=Accelerometer(
        S=_diagonal(STANDARD_GRAVITY_M_S2 / 16384.0),
        unit=AccelerationUnit.COUNTS,
        mass=ProofMass(resonance_hz=triple(3000.0)),
        noise=NoiseTerms(N=triple(0.4 * _MG), B=triple(0.05 * _MG), K=triple(1e-5)),
        adc=Adc(1.0, -32768.0, 32767.0),
    ),
    gyroscope=Gyroscope(
        S=_diagonal(_DEG / 131.0),
        unit=RateUnit.COUNTS,
        noise=NoiseTerms(N=triple(0.005 * _DEG), B=triple(6.0 * _DEG_PER_HOUR), K=triple(1e-6)),
        adc=Adc(1.0, -32768.0, 32767.0),
    ),
    clock=Clock(100.0),
    scale=(0.03, 0.03),
    misalignment=(0.02, 0.02),
    bias=(60.0 * _MG, 20.0 * _DEG),
)

# Analog Devices ADIS16405: gyro 0.05 °/s/LSB, ±300 °/s, 2.0 °/√h, 0.007 °/s in-run; accelerometer 3.33 mg/LSB, ±18 g,
# 0.2 m/s/√h, 0.2 mg in-run; both 330 Hz; misalignment 0.2° axis to axis; scale ±1 %.
ADIS = Profile(
    name="adis",
    accelerometer=Accelerometer(
        S=_diagonal(3.33 * _MG),
        unit=AccelerationUnit.COUNTS,
        mass=ProofMass(resonance_hz=triple(5500.0), gap_m=triple(1.3e-6)),
        noise=NoiseTerms(N=triple(0.2 * _PER_ROOT_HOUR), B=triple(0.2 * _MG), K=triple(1e-5)),
        adc=Adc(1.0, -8192.0, 8191.0),
    ),
    gyroscope=Gyroscope(
        S=_diagonal(0.05 * _DEG),
        unit=RateUnit.COUNTS,
        noise=NoiseTerms(N=triple(2.0 * _DEG * _PER_ROOT_HOUR), B=triple(0.007 * _DEG), K=triple(3e-6)),
        adc=Adc(1.0, -8192.0, 8191.0),
    ),
    clock=Clock(100.0),
    scale=(0.01, 0.01),
    misalignment=(0.0035, 0.0035),
    bias=(50.0 * _MG, 3.0 * _DEG),
)

# Sensonor STIM300 (10 g accelerometers): gyro 0.15 °/√h, 0.5 °/h, scale 500 ppm, 250 °/h, 1 mrad; accelerometer
# 0.06 m/s/√h, 0.05 mg, scale 300 ppm, ±0.75 mg, 1 mrad; 24-bit words (0.22 °/h, 1.9 µg).
TACTICAL = Profile(
    name="tactical",
    accelerometer=Accelerometer(
        noise=NoiseTerms(N=triple(0.06 * _PER_ROOT_HOUR), B=triple(0.05 * _MG), K=triple(5e-7)),
        adc=Adc(0.0019 * _MG, -10.0 * STANDARD_GRAVITY_M_S2, 10.0 * STANDARD_GRAVITY_M_S2),
    ),
    gyroscope=Gyroscope(
        noise=NoiseTerms(N=triple(0.15 * _DEG * _PER_ROOT_HOUR), B=triple(0.5 * _DEG_PER_HOUR), K=triple(3e-8)),
        adc=Adc(0.22 * _DEG_PER_HOUR, -400.0 * _DEG, 400.0 * _DEG),
    ),
    clock=Clock(250.0),
    scale=(3e-4, 5e-4),
    misalignment=(1e-3, 1e-3),
    bias=(0.75 * _MG, 250.0 * _DEG_PER_HOUR),
)

# A perfect IMU, to which effects can be added one at a time: no noise, no quantisation, SI.
IDEAL = Profile("ideal", Accelerometer(), Gyroscope(), Clock(100.0))

PROFILES: dict[str, Profile] = {p.name: p for p in (ANALOG_6DOF, MPU, ADIS, TACTICAL, IDEAL)}


def profile_by_name(name: str) -> Profile:
    """A class of IMU; raises ``InputError`` when no profile has that name."""
    if name not in PROFILES:
        raise InputError(f"no profile is called {name!r}{meant(name, PROFILES)}; there are {', '.join(PROFILES)}")
    return PROFILES[name]
