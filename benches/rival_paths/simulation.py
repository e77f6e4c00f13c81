"""What a simulated sensor is made of: its noise, its response, its motion."""

import numpy as np

from rival_paths.kalman import is_here

STEP_S = 0.01
N, B, K = 1e-3, 2e-4, 1e-5
"""White noise, bias instability, random walk, alike on three axes."""
RESONANCE_HZ, QUALITY = 30.0, 0.8


def data(n):
    """(n, 3) a signal, (n,) instants."""
    t = STEP_S * np.arange(n)
    signal = np.stack([np.sin(0.3 * t), np.cos(1.7 * t), np.sin(0.05 * t) * t / (1.0 + t)], axis=1)
    return signal, t


def ours():
    from trihedron import _core

    keys = [[10 * axis + term for term in range(4)] for axis in range(3)]
    return lambda _signal, t: _core.simulate_noise(len(t), STEP_S, [[0.0, N, B, K, 0.0]] * 3, keys)


def numpy_noise(flicker):
    def call(_signal, t):
        n, rng = len(t), np.random.default_rng(0)
        white = N / np.sqrt(STEP_S) * rng.standard_normal((n, 3))
        walk = K * np.sqrt(STEP_S) * np.cumsum(rng.standard_normal((n, 3)), axis=0)
        return white + walk + flicker(n, rng)

    return call


def shaped(n, rng):
    """Flicker from white noise shaped in frequency: as long as the log, and round at its ends."""
    frequency = np.fft.rfftfreq(n, STEP_S)
    frequency[0] = frequency[1]
    bins = rng.standard_normal((len(frequency), 3)) + 1j * rng.standard_normal((len(frequency), 3))
    return B * np.fft.irfft(bins / np.sqrt(frequency)[:, None], n, axis=0) * np.sqrt(n / (8.0 * np.pi * STEP_S))


def coloured(n, rng):
    import colorednoise

    return B * colorednoise.powerlaw_psd_gaussian(1.0, (3, n), random_state=rng).T


def numba_noise():
    import numba

    rates = 2.0 * np.pi * np.geomspace(1e-6, 10.0, 16)
    keep = np.exp(-rates * STEP_S)
    push = B * np.sqrt(1.0 - keep**2)

    @numba.njit(fastmath=True)
    def run(n, rng):
        out = np.empty((n, 3))
        for axis in range(3):
            walk, states = 0.0, np.zeros(len(keep))
            for k in range(n):
                total = 0.0
                for s in range(len(keep)):
                    states[s] = keep[s] * states[s] + push[s] * rng.standard_normal()
                    total += states[s]
                walk += K * np.sqrt(STEP_S) * rng.standard_normal()
                out[k, axis] = N / np.sqrt(STEP_S) * rng.standard_normal() + walk + total
        return out

    return lambda _signal, t: run(len(t), np.random.default_rng(0))


numba_noise.__name__ = "numba_chain"
NOISE = {
    "trihedron": ours,
    "NumPy, shaped in frequency": numpy_noise(shaped),
    "NumPy and colorednoise": numpy_noise(coloured) if is_here("colorednoise") else None,
    "numba, sixteen Gauss-Markov processes": numba_noise if is_here("numba") else None,
}


def ours_response():
    from trihedron import _core

    return lambda signal, _t: _core.simulate_second_order(signal, STEP_S, [RESONANCE_HZ] * 3, [QUALITY] * 3)


ours_response.__name__ = "ours"


def recursion():
    """Numerator, denominator of the same low-pass driven by straight lines between samples."""
    from scipy.signal import cont2discrete

    w = 2.0 * np.pi * RESONANCE_HZ
    b, a, _ = cont2discrete(([w * w], [1.0, w / QUALITY, w * w]), STEP_S, method="foh")
    return np.ravel(b), a


def scipy_response(signal, _t):
    from scipy.signal import lfilter, lfilter_zi

    b, a = recursion()
    zi = lfilter_zi(b, a)[:, None] * signal[:1]
    return lfilter(b, a, signal, axis=0, zi=zi)[0]


def numba_response():
    import numba
    from scipy.signal import lfilter_zi

    @numba.njit(fastmath=True)
    def run(signal, b, a, zi):
        out = np.empty_like(signal)
        for axis in range(3):
            first, second = zi[0] * signal[0, axis], zi[1] * signal[0, axis]
            for k in range(len(signal)):
                x = signal[k, axis]
                y = b[0] * x + first
                first = b[1] * x - a[1] * y + second
                second = b[2] * x - a[2] * y
                out[k, axis] = y
        return out

    b, a = recursion()
    zi = lfilter_zi(b, a)
    return lambda signal, _t: run(signal, b, a, zi)


numba_response.__name__ = "numba_chain"
RESPONSE = {
    "trihedron": ours_response,
    "SciPy lfilter": scipy_response,
    "numba": numba_response if is_here("numba") else None,
}


def plan(t):
    """A hand session as long as the instants: its plan."""
    from trihedron.simulate import hand_session
    from trihedron.simulate.motion.plan import plan_motion

    rng = np.random.default_rng(0)
    per_pose = plan_motion(hand_session(n_poses=12), rng).duration_s / 12.0
    return plan_motion(hand_session(n_poses=max(int(t[-1] / per_pose), 4)), rng)


def ours_motion():
    made = {}

    def call(_signal, t):
        if len(t) not in made:
            made[len(t)] = plan(t)
        return made[len(t)].evaluate(np.minimum(t, made[len(t)].duration_s), 9.81)

    return call


ours_motion.__name__ = "ours"
KNOTS = 5
"""Samples between the attitudes that a spline is given."""


def scipy_motion():
    """Attitude and rate from a rotation spline through attitudes; the force is gravity turned into the body."""
    from scipy.spatial.transform import Rotation, RotationSpline

    def call(signal, t):
        spline = RotationSpline(t[::KNOTS], Rotation.from_rotvec(signal[::KNOTS]))
        turned = spline(t)
        return turned.as_quat(), spline(t, 1), spline(t, 2), turned.inv().apply([0.0, 0.0, 9.81])

    return call


scipy_motion.__name__ = "numba_chain"


def pyins_motion():
    from pyins import sim

    return lambda signal, t: sim.generate_imu(t, [50.0, 10.0, 0.0], np.degrees(signal), np.zeros_like(signal))


pyins_motion.__name__ = "numba_chain"
MOTION = {
    "trihedron": ours_motion,
    "SciPy RotationSpline, a knot in five samples": scipy_motion,
    "pyins generate_imu": pyins_motion if is_here("pyins") else None,
}
