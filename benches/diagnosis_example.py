"""The example of the README: a quadratic response found, modelled, and taken off another session.

Run: python benches/diagnosis_example.py
"""

from __future__ import annotations

import trihedron
from trihedron.pipeline import extend
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate, with_effect

K2 = (3e-4, -2e-4, 2e-4)
GRAVITY = 9.80665


def session(layout: int, seed: int) -> trihedron.Recording:
    """24 poses by hand of the same flawed unit."""
    profile = profile_by_name("mpu")
    accelerometer, gyroscope = profile.unit(1)
    scenario = Scenario(hand_session(24, layout=layout), "session", accelerometer, gyroscope, profile.clock)
    return simulate(with_effect(scenario, "accel-quadratic", k2=K2), seed)[0]


def main() -> None:
    """Print the report and the errors of both calibrations on the other session."""
    first, second = session(1, 1), session(2, 2)
    print(trihedron.diagnose(first, gravity_m_s2=GRAVITY))
    linear = trihedron.calibrate(first, gravity_m_s2=GRAVITY)
    for name, result in (("linear", linear), ("extended", extend(linear))):
        v = trihedron.verify(result, second).verification
        print(f"{name}: gravity at rest missed by {1e3 * v.norm_rms:.2f} mm/s² rms, moves by {v.angle_rms_deg:.3f}°")


if __name__ == "__main__":
    main()
