"""What a part makes of a motion, the log that a board writes of it, and the truth in the frame that is asked for."""

from dataclasses import dataclass

import numpy as np

from review_walk.body import G

DEG = np.pi / 180.0


@dataclass
class Part:
    """A part as bought: SI units; `bits` of a converter, 0 for none."""

    gyro_range: float = 500.0 * DEG
    accel_range: float = 4.0 * G
    gyro_bits: int = 16
    accel_bits: int = 16
    gyro_white: float = 0.006 * DEG
    accel_white: float = 1.0e-3
    gyro_flicker: float = 1.0 / 3600.0 * DEG
    accel_flicker: float = 2e-4
    crossed: float = 0.012
    gyro_zero: float = 0.5 * DEG
    accel_zero: float = 0.25
    gyro_axes: tuple = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    accel_axes: tuple = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass
class Truth:
    """Raw to SI in the frame of the body: f = S_f a' + b_f, ω = S_w w' + b_w."""

    S_f: np.ndarray
    b_f: np.ndarray
    S_w: np.ndarray
    b_w: np.ndarray

    def lower(self, signs=(1.0, 1.0, 1.0)):
        """The same in the frame in which S_f is lower triangular with a diagonal of the signs given."""
        Q, R = np.linalg.qr(self.S_f[::-1, ::-1])
        L, U = R[::-1, ::-1], Q[::-1, ::-1].T
        flip = (np.sign(np.diag(L)) * signs)[:, None]
        L, U = flip * L, flip * U
        return Truth(L, U @ self.b_f, U @ self.S_w, U @ self.b_w)


def flicker(n, rate_hz, rng):
    """(n, 3) of unit B: first-order processes two to an octave, from two samples to four logs."""
    slow, fast = 4.0 * n / rate_hz, 2.0 / rate_hz
    times = np.geomspace(fast, slow, int(2 * np.log2(slow / fast)) + 1)
    ratio = np.log(times[1] / times[0])
    x = np.zeros((n, 3))
    for tau in times:
        # The sum over τ, evenly in log τ, of 2σ²τ/(1 + (ωτ)²) is πσ²/(ω ratio): the two-sided density B²/(2πf).
        sigma = np.sqrt(ratio / np.pi)
        a = np.exp(-1.0 / (rate_hz * tau))
        x += ornstein(n, a, sigma, rng)
    return x - x.mean(axis=0)


def ornstein(n, a, sigma, rng):
    """(n, 3) first-order process of standard deviation sigma and step correlation a, by blocks of one matrix."""
    block = 64
    kernel = np.tril(a ** np.abs(np.subtract.outer(np.arange(block), np.arange(block))))
    steps = rng.normal(size=(-(-n // block), block, 3)) * sigma * np.sqrt(1.0 - a * a)
    inside = np.einsum("ij,bjk->bik", kernel, steps)
    start, out = rng.normal(size=3) * sigma, []
    carry = a ** np.arange(1, block + 1)[:, None]
    for part in inside:
        out.append(part + carry * start)
        start = out[-1][-1]
    return np.concatenate(out)[:n]


def filtered(motion, t, order, lag_s, which):
    """Rate or force behind `order` equal first-order lags that sum to `lag_s`; order 0 is a pure delay."""
    if order == 0:
        return motion.sense(t - lag_s)[which]
    fine = 1e-3
    at = np.arange(t[0] - 20.0 * lag_s, t[-1] + fine, fine)
    x = motion.sense(np.clip(at, 0.0, motion.at - fine))[which]
    tau = lag_s / order
    age = np.arange(0.0, 20.0 * lag_s, fine)
    kernel = (age ** (order - 1)) * np.exp(-age / tau)
    kernel[0] *= 0.5
    kernel /= kernel.sum()
    n = 2 ** int(np.ceil(np.log2(len(at) + len(age))))
    y = np.fft.irfft(np.fft.rfft(x, n, axis=0) * np.fft.rfft(kernel, n)[:, None], n, axis=0)[: len(at)]
    return np.column_stack([np.interp(t, at, column) for column in y.T])


def read_out(motion, part, rate_hz, rng, behind=None):
    """Time [s], counts of accelerometer and gyro, and the truth; `behind` a lag of the gyro: its order and size [s]."""
    t = np.arange(0.0, motion.at, 1.0 / rate_hz)
    w, f = motion.sense(t)
    if behind is not None:
        w = filtered(motion, t, *behind, 0)
    out, truth = [], []
    for name, x in (("accel", f), ("gyro", w)):
        get = lambda key, name=name: getattr(part, f"{name}_{key}")  # noqa: E731
        mix = np.array(get("axes"), dtype=float) @ (np.eye(3) + rng.normal(size=(3, 3)) * part.crossed)
        zero = rng.normal(size=3) * get("zero")
        y = x @ mix.T + zero + rng.normal(size=x.shape) * get("white") * np.sqrt(rate_hz)
        y += get("flicker") * flicker(len(t), rate_hz, rng)
        step = 2.0 * get("range") / 2 ** (get("bits") or 24)
        top = 2 ** ((get("bits") or 24) - 1)
        out.append(np.clip(np.round(y / step), -top, top - 1))
        back = np.linalg.inv(mix)
        truth += [back * step, -back @ zero]
    return t, *out, Truth(*truth)


def write(path, t, a, w, steps=(1.0, 1.0), time_factor=1.0, header="t,ax,ay,az,gx,gy,gz"):
    """A CSV of counts, or of counts times a driver's step."""
    whole = steps == (1.0, 1.0)
    table = np.column_stack([t * time_factor, a * steps[0], w * steps[1]])
    fmt = ["%.6f" if time_factor == 1.0 else "%.3f"] + (["%d"] * 6 if whole else ["%.9g"] * 6)
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt=fmt)


def score(result, truth, is_case=False, signs=(1.0, 1.0, 1.0)):
    """z-scores of the accelerometer's S and b, the gyro's S and b, and the largest relative error of the gyro's S."""
    truth = truth if is_case else truth.lower(signs)
    a, g = result.accelerometer, result.gyroscope
    low = np.nonzero(np.ones((3, 3)) if is_case else np.tril(np.ones((3, 3))))
    z = {"S_f": (a.S - truth.S_f)[low] / a.sigma_S[low], "b_f": (a.b - truth.b_f) / a.sigma_b}
    if g is not None:
        z |= {"S_w": ((g.S - truth.S_w) / g.sigma_S).ravel(), "b_w": (g.b - truth.b_w) / g.sigma_b}
        z["error"] = np.abs(g.S - truth.S_w).max() / np.abs(truth.S_w).max()
    return z
