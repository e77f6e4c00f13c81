"""Could the flaw be seen at all? The log with it against the same log without, in the domains a diagnosis has.

Differences in what poses and moves say are weighed by noise, flicker and scatter, after taking off all that a linear
calibration could take up: a chi-square that a perfect observer would have.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from desk_trial.readout import Log
from desk_trial.session import Made
from desk_trial.turns import Array, conjugate, exponential, product, turned

SEEN = 30.0
"""Chi-square above which a flaw is called visible: 5.5 sigma for one number, plain for a dozen too."""
LEAST_ROWS = 3
NOT_ASKED = {
    "accel-size-effect", "accel-gyro-time-offset", "sensor-lag", "dropped-samples", "timing-jitter", "stale-accel",
    "periodic-interference", "quantisation", "glitches",
}  # fmt: skip
"""They show in the accelerations of a move, in stamps or within a pose, where nothing is weighed here."""


class Differences:
    """Poses and moves of one log under the true linear model, and what a linear error would put there."""

    def __init__(self, made: Made, log: Log) -> None:
        rate = made.session.rate_hz * (1 + made.unit.clock_error)
        f = (log.accel - log.accel_zero) @ np.linalg.inv(made.body.accel_matrix).T
        w = (log.gyro - log.gyro_zero) @ np.linalg.inv(made.body.gyro_matrix).T
        cores = []
        for i in range(made.session.poses):
            rows = np.flatnonzero(log.pose == i)
            first = int(0.2 * len(rows))
            cores.append(rows[first : max(first + LEAST_ROWS, int(0.9 * len(rows)))])
        means = np.array([f[c].mean(0) for c in cores])
        self.norms = np.linalg.norm(means, axis=1)
        self.ups = means / self.norms[:, None]
        self.zeros = np.array([w[c].mean(0) for c in cores])
        self.hold_s = np.array([len(c) for c in cores]) / rate
        self.move_s = np.array([b[0] - a[-1] for a, b in pairwise(cores)]) / rate
        lower = np.tril_indices(3)
        self.norm_basis = np.array(
            [np.r_[np.outer(u, m)[lower], u] for u, m in zip(self.ups, means, strict=True)]
        )  # fmt: skip
        self.turns: list[Array] = []
        self.turn_basis: list[Array] = []
        for i, (a, b) in enumerate(pairwise(cores)):
            self._move(np.arange(a[-1], b[0] + 1), i, w, 1 / rate)

    def _move(self, rows: npt.NDArray[np.int64], i: int, w: Array, step: float) -> None:
        """Where gravity should be after the move against where it is (rad), and the same for every gyro error."""
        zero = self.zeros[i] + np.linspace(0, 1, len(rows))[:, None] * (self.zeros[i + 1] - self.zeros[i])
        rates = w[rows] - zero
        steps = exponential(0.5 * (rates[1:] + rates[:-1]) * step)
        q = np.zeros((len(rows), 4))
        q[0, 0] = 1
        for k, turn in enumerate(steps):
            q[k + 1] = product(q[k], turn)
        last = conjugate(q[-1])
        self.turns.append(np.cross(turned(last, self.ups[i]), self.ups[i + 1]))
        basis = []
        for axis in np.eye(3):
            along = turned(q, axis)
            for c in range(3):
                moved = turned(last, np.cross((along * rates[:, c : c + 1]).sum(0) * step, self.ups[i]))
                basis.append(-np.cross(moved, self.ups[i + 1]))
        self.turn_basis.append(np.array(basis).T)


def _unexplained(difference: Array, basis: Array, sigma: Array) -> float:
    X = basis / sigma[:, None]
    X = X / (np.linalg.norm(X, axis=0) + 1e-30)
    y = difference / sigma
    return float(((y - X @ np.linalg.lstsq(X, y, rcond=1e-7)[0]) ** 2).sum())


def visibility(made: Made) -> dict[str, float]:
    """Domain → chi-square of the flaw beyond a linear calibration; nothing where that is not asked."""
    if made.flaw.get("id", "none") in {"none", *NOT_ASKED} or len(made.log.accel) != len(made.healthy.accel):
        return {}
    on, off = Differences(made, made.log), Differences(made, made.healthy)
    u, s = made.unit, made.session
    white_a, white_w = u.accel_density / np.sqrt(2), u.gyro_density / np.sqrt(2)
    sigma_a = np.sqrt(white_a**2 / on.hold_s + u.accel_flicker**2 + s.accel_scatter**2 + 1e-8)
    wander = u.gyro_flicker**2 + s.gyro_scatter**2
    zeros = on.zeros - off.zeros
    zeros -= zeros.mean(0)
    sigma_m = np.sqrt(
        white_w**2 * on.move_s + wander * on.move_s**2 + (white_a / 9.8) ** 2 / on.hold_s[:-1] * 2 + 1e-9
    )  # fmt: skip
    turns = (np.array(on.turns) - np.array(off.turns)).ravel()
    return {
        "static-accel": _unexplained(on.norms - off.norms, on.norm_basis, sigma_a),
        "static-gyro": float((zeros**2 / (white_w**2 / on.hold_s + wander)[:, None]).sum()),
        "moves": _unexplained(turns, np.array(on.turn_basis).reshape(-1, 9), np.repeat(sigma_m, 3)),
    }
