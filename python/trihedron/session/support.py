"""Supports that yield: the sensor rotates inside its poses, and gravity shows it (docs/diagnosis-method.md, 8.7d)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.defaults import FALSE_ALARM
from trihedron.records.recording import Recording
from trihedron.records.segments import Pose
from trihedron.session.noise import FEWEST_POSES, SessionNoise
from trihedron.session.rounding import UNIFORM, undithered_axes

CERTAIN = 2.0 * math.log(1.0 / FALSE_ALARM - 1.0)
"""Twice the logarithm of the odds at which biases that scatter are certain beside a support: those at which they are
named."""


@dataclass(frozen=True, eq=False)
class Support:
    """Motion of the sensor with its support inside the poses.

    ``score``: twice the log-likelihood that it gains over biases that scatter, by noise unless more is certain beside
    it, and over an accelerometer that creeps, less the cost of the time constants tried; ``of_bias`` the same of a bias
    that settles, as far as gravity prefers it. ``rate`` (h, 2, 3): mean rate of every pose by the motion and its
    variance, rad/s; ``leans`` (h, 2, 3): change of the vertical from the mean over a pose to the end of the move before
    and to the beginning of the next; ``edge_variance`` (h, 2) rad² of that rotation.
    """

    score: float
    of_bias: float
    rate: FloatArray
    leans: FloatArray
    edge_variance: FloatArray

    @property
    def yields(self) -> bool:
        """Whether it is likelier than not that it does, and no bias that settles instead is certain."""
        return self.score > 0.0 and self.of_bias < CERTAIN

    def applied(
        self, mean: FloatArray, sigma: FloatArray, unresolved: FloatArray, before: IntArray, gyro_S: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Raw mean rates (h, 3) of the poses without the motion, their standard errors with its own, and variances (m,
        4, 3) of the integrals over the moves that begin in the poses ``before`` (m,), (raw unit · s)², with those of
        their two ends."""
        raw, ends = np.linalg.inv(gyro_S), self.edge_variance[before, 1] + self.edge_variance[before + 1, 0]
        turned = unresolved.copy()
        turned[:, 3] += ends[:, None] * (raw**2).sum(axis=1)
        return mean - self.rate[:, 0] @ raw.T, np.sqrt(sigma**2 + self.rate[:, 1] @ (raw**2).T), turned


def support_of(
    recording: Recording, poses: Sequence[Pose], moves: Iterable[tuple[int, int, int]], noise: SessionNoise,
    near: tuple[FloatArray, FloatArray, FloatArray], gravity_m_s2: float,
) -> Support | None:  # fmt: skip
    """Settling of the support against scatter of the biases (eq. 8.7d); ``None`` without a gyro, or with few poses.

    ``moves``: the pose before each, its first sample and one past its last. ``near``: S of the gyro and of the
    accelerometer, and the verticals (h, 3) in the body.
    """
    if noise.rate_density is None or recording.gyroscope is None or recording.accelerometer is None:
        return None
    # A pose that was disturbed has steps besides: it says nothing of its support.
    spans = np.array([(pose.start, pose.start if pose.disturbed else pose.stop) for pose in poses], dtype=np.int64)
    edges = spans.copy()
    for before, start, stop in moves:
        edges[before, 1], edges[before + 1, 0] = start, stop
    step_s, n = 1.0 / recording.rate_hz, np.maximum(spans[:, 1] - spans[:, 0], 1)
    errors = []
    steps = (recording.facts.of(name).step for name in ("gyroscope", "accelerometer"))
    for step, density in zip(steps, (noise.rate_density, noise.force_density), strict=True):
        rounding = UNIFORM * step**2 * undithered_axes(step, density / np.sqrt(step_s))
        errors.append(np.sqrt(density**2 / (n * step_s)[:, None] + rounding))
    found = _core.settling_of_poses(
        (recording.gyroscope, recording.accelerometer), near[:2], (errors[0], errors[1]), near[2],
        (spans, np.sort(edges, axis=1)), gravity_m_s2=gravity_m_s2, step_s=step_s, fewest=FEWEST_POSES, certain=CERTAIN,
    )  # fmt: skip
    return None if found is None else Support(*found)
