"""Resolution too coarse for the noise: means of still poses sit on steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.observations import FloatArray, Observations
from trihedron.diagnose.within_static import CHANNELS
from trihedron.records.diagnosis import EffectParameter, Where


@dataclass(frozen=True)
class Lattice:
    """The grid of one channel: step in raw units, and the error of a mean that the grid alone makes (rms)."""

    channel: int
    step: float
    sigma_before: float
    mean_error: float
    missing: int


def lattice(values: FloatArray, sigma: float) -> tuple[float, int] | None:
    """Step of the grid on which all values lie and the number of codes skipped amid visited ones, or ``None``."""
    codes, counts = np.unique(values, return_counts=True)
    if len(codes) < 3 or len(codes) > 0.2 * len(values):
        return None
    gaps = np.diff(codes)
    tiny = 1e-6 * float(np.max(np.abs(codes)) + 1e-300)
    gaps = gaps[gaps > tiny]
    if len(gaps) == 0:
        return None
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    ratio = gaps / step
    if np.mean(np.abs(ratio - np.round(ratio)) < 0.02) < 0.98:
        return None
    # A code is missing where both neighbours are visited so often that its absence is no accident.
    index = np.round((codes - codes[0]) / step).astype(int)
    visited = dict(zip(index.tolist(), counts.tolist(), strict=True))
    missing = 0
    if sigma > 0.5 * step:
        for k in range(1, index[-1]):
            if k not in visited and min(visited.get(k - 1, 0), visited.get(k + 1, 0)) > 20:
                missing += 1
    return step, missing


class Quantisation(DirectEffect):
    """Steps so wide against the noise that averaging no longer resolves between them."""

    id = "quantisation"
    mechanism = "the resolution is too coarse for the noise: means of still poses sit on steps"
    experiment = "choose a finer range, or add a little motion or noise (dither) while averaging"

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        found: list[Lattice] = []
        pieces = [obs.raw_force] + ([obs.raw_rate] if obs.raw_rate is not None else [])
        rows = np.concatenate([hold.samples() for hold in obs.segments.holds])
        errors = np.zeros(6)
        for c, channel in enumerate(np.hstack(pieces)[rows].T):
            values = channel[np.isfinite(channel)]
            sigma = float(np.sqrt(np.median([np.var(np.hstack(pieces)[h.samples(), c]) for h in obs.segments.holds])))
            grid = lattice(np.round(values, 9), sigma)
            if grid is None:
                continue
            step, missing = grid
            before = float(np.sqrt(max(sigma**2 - step**2 / 12.0, (0.05 * step) ** 2)))
            # Mean error of a quantised Gaussian: first Fourier term of the staircase (Widrow), rms over the phase.
            bias = step / np.pi * float(np.exp(-2.0 * np.pi**2 * (before / step) ** 2)) / np.sqrt(2.0)
            if sigma < 0.35 * step:
                bias = step / np.sqrt(12.0)
            if missing and sigma < 1.5 * step:
                bias = max(bias, 0.25 * step)  # wider noise averages over a missing code as over any other
            mean_sigma = obs.hold_force_sigma[:, c] if c < 3 else obs.hold_rate_sigma[:, c - 3]  # type: ignore[index]
            if bias > 1.0 * float(np.median(mean_sigma)):
                found.append(Lattice(c, step, before, bias, missing))
                errors[c] = bias
        if not found:
            return None
        parameters = []
        for grid_found in found:
            c = grid_found.channel
            S = context.fitted.twin.accel_S if c < 3 else context.fitted.twin.gyro_S
            scale = float(1.0 / np.linalg.norm(np.linalg.inv(S)[c % 3]))
            unit = "m/s^2" if c < 3 else "rad/s"
            name = CHANNELS[c]
            parameters.append(
                EffectParameter(f"lsb_{name}", grid_found.step * scale, 1e-6 * grid_found.step * scale, unit)
            )
            if grid_found.missing:
                parameters.append(EffectParameter(f"missing_codes_{name}", float(grid_found.missing), 0.0, "1"))

        def reweigh(old: Observations) -> Observations:
            force = np.sqrt(old.hold_force_sigma**2 + errors[:3] ** 2)
            rate = None if old.hold_rate_sigma is None else np.sqrt(old.hold_rate_sigma**2 + errors[3:] ** 2)
            return replace(old, hold_force_sigma=force, hold_rate_sigma=rate)

        worst = max(found, key=lambda one: one.step / max(one.sigma_before, 1e-300))
        strength = float(sum((errors[one.channel] / one.step) ** 2 for one in found) * len(rows))
        names = tuple(CHANNELS[one.channel] for one in found)
        return Evidence(
            1e-300, strength, tuple(parameters),
            f"Readings of {', '.join(names)} move in steps of {worst.step:.4g} raw units, wide against their noise: "
            "averaging does not resolve between steps.",
            "within-static", Where(names), reweigh=reweigh,
        )  # fmt: skip
