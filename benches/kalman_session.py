"""The article's experiment, sample by sample and apart from the package: what the Kalman proof scripts share.

324 poses of a dividing head, 5 s hold and 5 s turn each, 20 Hz; noise of known Allan coefficients drawn in the time and
frequency domain (white, first differences, random walk, 1/f by its spectrum, a straight ramp); 12-bit converter.
"""

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.80665
CONSTANTS = np.array([0.032002 / GRAVITY, -0.0017435 / GRAVITY, 7.4811e-5 / GRAVITY, -2.5865])
"""Published constants of axis x, V/(m/s²) and V."""
STEP = 5.0 / 4096
"""12 bits over 5 V."""
SIGMA = 0.11 * CONSTANTS[0]
"""The article's noise of one reading, V."""
RATE = 20.0
HOLD_S, TURN_S = 5.0, 5.0

roll, pitch = (np.radians(a.ravel()) for a in np.meshgrid(np.arange(0, 81, 10), np.arange(0, 351, 10), indexing="ij"))
REFERENCES = GRAVITY * np.column_stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
N = len(REFERENCES)
START = (HOLD_S + TURN_S) * np.arange(N)
SESSION_S = START[-1] + HOLD_S


@dataclass(frozen=True)
class Mix:
    """Allan coefficients in volts, and whether readings are rounded by the 12-bit converter."""

    name: str
    white: float = 0.0
    quantisation: float = 0.0
    flicker: float = 0.0
    walk: float = 0.0
    ramp: float = 0.0
    converter: bool = False
    contiguous: bool = False

    def coefficients(self):
        return {k: getattr(self, k) for k in ("quantisation", "white", "flicker", "walk", "ramp")}


WHITE = SIGMA * np.sqrt(HOLD_S)
"""Density whose mean over a hold scatters by 0.11 m/s²."""
FLAT = 0.664
"""Allan deviation of flicker noise over B."""

MIXES = (
    Mix("12-bit converter alone", converter=True),
    Mix("white 0.11", white=WHITE),
    Mix("quantisation 0.11 (first difference, no pauses)", quantisation=SIGMA * HOLD_S / np.sqrt(2), contiguous=True),
    Mix("white + flicker floor 0.11", white=WHITE, flicker=SIGMA / FLAT),
    Mix("white/10 + flicker floor 0.11", white=WHITE / 10, flicker=SIGMA / FLAT),
    Mix("white + walk to 0.11", white=WHITE, walk=SIGMA / np.sqrt(SESSION_S)),
    Mix("white + walk to 0.55", white=WHITE, walk=5 * SIGMA / np.sqrt(SESSION_S)),
    Mix("white/10 + walk to 0.55", white=WHITE / 10, walk=5 * SIGMA / np.sqrt(SESSION_S)),
    Mix("white/30 + walk to 1.1", white=WHITE / 30, walk=10 * SIGMA / np.sqrt(SESSION_S)),
    Mix("white + ramp to 0.11", white=WHITE, ramp=SIGMA / SESSION_S),
    Mix("white + ramp to 0.55", white=WHITE, ramp=5 * SIGMA / SESSION_S),
    Mix("white/10 + ramp to 0.55", white=WHITE / 10, ramp=5 * SIGMA / SESSION_S),
    Mix(
        "the article's four, 0.055 each",
        white=WHITE / 2,
        flicker=SIGMA / FLAT / 2,
        walk=SIGMA / 2 / np.sqrt(SESSION_S),
        ramp=SIGMA / 2 / SESSION_S,
    ),
    Mix(
        "the article's four + converter",
        white=WHITE / 2,
        flicker=SIGMA / FLAT / 2,
        walk=SIGMA / 2 / np.sqrt(SESSION_S),
        ramp=SIGMA / 2 / SESSION_S,
        converter=True,
    ),
)


def flicker_noise(n, b, rng):
    """1/f noise of two-sided spectrum B²/(2πf) at 20 Hz: shaped in the frequency domain, four times as long."""
    m = 4 * n
    f = np.fft.rfftfreq(m, 1.0 / RATE)
    spectrum = np.zeros(len(f))
    spectrum[1:] = b * b / (2 * np.pi * f[1:])
    z = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    x = np.fft.irfft(z * np.sqrt(spectrum * RATE * m / 2), m)
    at = rng.integers(0, m - n)
    return x[at : at + n]


def readings(mix, seed, references=REFERENCES):
    """Mean readings (n,), starts and lengths of the holds; and the drift of slow noise since the start (n,)."""
    rng = np.random.default_rng(seed)
    pause = 0.0 if mix.contiguous else TURN_S
    per_hold, per_turn = int(HOLD_S * RATE), int(pause * RATE)
    per_pose = per_hold + per_turn
    n = len(references) * per_pose
    dt = 1.0 / RATE
    x = np.zeros(n)
    if mix.flicker:
        x += flicker_noise(n, mix.flicker, rng)
    if mix.walk:
        # The mean of a walk over a sample is what a sampler sees; at 100 samples per hold its value is close enough.
        x += mix.walk * np.sqrt(dt) * np.cumsum(rng.standard_normal(n))
    if mix.ramp:
        x += mix.ramp * rng.standard_normal() * dt * np.arange(n)
    if mix.white:
        x += mix.white / np.sqrt(dt) * rng.standard_normal(n)
    if mix.quantisation:
        x += mix.quantisation / dt * np.diff(rng.standard_normal(n + 1))
    clean = references @ CONSTANTS[:3] + CONSTANTS[3]
    samples = clean[:, None] + x.reshape(len(references), per_pose)[:, :per_hold]
    if mix.converter:
        # Where the steps lie differs from converter to converter; without it every seed would round the same way.
        shift = STEP * rng.random()
        samples = np.round((samples - shift) / STEP) * STEP + shift
    start = (HOLD_S + pause) * np.arange(len(references))
    return samples.mean(axis=1), start, np.full(len(references), HOLD_S)
