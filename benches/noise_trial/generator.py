"""Rate readings of known noise terms, made twice in ways that share nothing: by recursion in time, and by spectrum.

By recursion: white numbers; a walk as their sum; flicker as a bank of first-order recursions of octave spaced time
constants, started in their stationary state; quantisation as the rounding of the angle, from which rate is the
difference. By spectrum: random phases on a circle 32 times as long as the log, from the two-sided densities alone.
"""

import numpy as np
from scipy.signal import lfilter


def in_time(rng, n, rate_hz, Q=0.0, N=0.0, B=0.0, K=0.0, R=0.0):
    """(n,) readings by recursion."""
    h = 1.0 / rate_hz
    x = np.zeros(n)
    if N:
        x += N / np.sqrt(h) * rng.standard_normal(n)
    if K:
        x += K * np.sqrt(h) * np.cumsum(rng.standard_normal(n))
    if B:
        x += B * flicker_bank(rng, n)
    if R:
        x += R * h * (np.arange(n) - n / 2)
    if Q:
        x = rounded_angle(rng, x, h, Q)
    return x


def flicker_bank(rng, n, ratio=2.0):
    """(n,) readings of two-sided density 1/(2 pi f): time constants in octaves, from half a reading to 32 logs."""
    count = int(np.ceil(np.log(64.0 * n) / np.log(ratio))) + 1
    tau = 0.5 * ratio ** np.arange(count)
    sigma = np.sqrt(np.log(ratio) / np.pi)
    out = np.zeros(n)
    for time in tau:
        decay = np.exp(-1.0 / time)
        drive = rng.standard_normal(n) * (sigma * np.sqrt(1.0 - decay**2))
        start = sigma * rng.standard_normal()
        out += lfilter([1.0], [1.0, -decay], drive, zi=[decay * start])[0]
    return out


def rounded_angle(rng, rate, h, Q):
    """Rate as the difference of an angle in whole steps of sqrt(12) Q."""
    step = np.sqrt(12.0) * Q
    angle = np.concatenate([[0.0], np.cumsum(rate * h)]) + step * rng.random()
    return np.diff(np.round(angle / step)) * step / h


def by_spectrum(rng, n, rate_hz, Q=0.0, N=0.0, B=0.0, K=0.0, circle=32):
    """(n,) readings from the densities alone; quantisation and walk through the sampled operators (no ramp)."""
    h, m = 1.0 / rate_hz, circle * n
    f = np.fft.rfftfreq(m, h)[1:]
    omega = 2.0 * np.sin(np.pi * f * h) / h
    density = (Q * omega) ** 2 * h + N**2 + B**2 / (2 * np.pi * f) + (K / omega) ** 2
    coefficient = np.sqrt(density * m / h / 2.0) * (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f)))
    coefficient[-1] = np.sqrt(2.0) * coefficient[-1].real
    return np.fft.irfft(np.concatenate([[0.0], coefficient]), m)[:n]


def octave_power(x):
    """Mean power of the windowed spectrum per octave of one log, straight line removed."""
    n = len(x)
    t = np.arange(n) - (n - 1) / 2
    y = x - x.mean() - t * (t @ x) / (t @ t)
    power = np.abs(np.fft.rfft(y * np.hanning(n))) ** 2
    edges = 2 ** np.arange(1, int(np.log2(n)))
    return np.array([power[a : 2 * a].mean() for a in edges])


def agree(runs=300, n=4096, rate_hz=100.0):
    """Print the ratio of both generators' spectra per octave; the worst z below the upper two octaves.

    There flicker has no agreed form: a sampled recursion aliases, a density does not.
    """
    rng = np.random.default_rng(7)
    worst = 0.0
    for terms in ({"N": 1e-2}, {"K": 1e-2}, {"B": 1e-2}, {"Q": 3e-4, "N": 1e-2}, {"N": 1e-2, "B": 5e-3, "K": 3e-3}):
        one = np.array([octave_power(in_time(rng, n, rate_hz, **terms)) for _ in range(runs)])
        two = np.array([octave_power(by_spectrum(rng, n, rate_hz, **terms)) for _ in range(runs)])
        ratio = one.mean(axis=0) / two.mean(axis=0)
        error = np.hypot(one.std(axis=0) / one.mean(axis=0), two.std(axis=0) / two.mean(axis=0)) / np.sqrt(runs)
        z = (ratio - 1.0) / error
        worst = max(worst, float(np.abs(z[:-2]).max()))
        print(f"  {terms}: " + " ".join(f"{r:.3f}" for r in ratio), f"| largest z {np.abs(z).max():.1f}", flush=True)
    return worst
