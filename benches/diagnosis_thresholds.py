"""How near healthy sessions come to the thresholds of the diagnosis: the calibration that their names cite.

    python benches/diagnosis_thresholds.py --sessions 60 --seed 11
    python benches/diagnosis_thresholds.py --sessions 60 --seed 11 --flicker

Every session is healthy, hand-moved poses and table turns in turn, three noise grades in turn; with `--flicker` all are
of another generator (`benches/nuisance_trial`), without its nuisances, with 1/f noise as consumer parts have it. For
every statistic that a threshold of `diagnose/` is held against: median, 95 % point and extreme over the sessions, and
how many pass.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
from scipy.special import chdtrc
from scipy.stats import beta

import trihedron
from blind_trial.draw import GRADES, Job, grade_profile, make, table_session
from nuisance_trial.draw import G, draw
from trihedron.diagnose.effects.sample_steps import find_losses, step_errors
from trihedron.diagnose.effects.table_tilt import TableTilt
from trihedron.diagnose.effects.table_turns import table_turns
from trihedron.diagnose.effects.timing_jitter import STEP_FACTOR, common_time_error
from trihedron.diagnose.effects.turn_angle_error import _without_common_scale
from trihedron.diagnose.residuals.goodness_of_fit import AT_EDGE, hidden_zeros
from trihedron.diagnose.residuals.within_holds import find_lines, hold_scatter
from trihedron.diagnose.selection.model import begin
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.starting_point import start_twin
from trihedron.pipeline.reading import segments_of
from trihedron.records import Recording
from trihedron.simulate import Scenario, simulate

Row = tuple[str, float, float]
"""Statistic, threshold, value in this session."""


def healthy(k: int, seed: int) -> tuple[Recording, float]:
    """The k-th session of a seed and |g|."""
    grade = GRADES[k // 2 % len(GRADES)]
    if k % 2 == 0:
        recording, gravity, _ = make(Job((), grade, seed * 1000 + k))
        return recording, gravity
    rng = np.random.default_rng([seed, k])
    profile = grade_profile(grade)
    accelerometer, gyroscope = profile.unit(int(rng.integers(1, 10000)))
    scenario = Scenario(
        table_session(int(rng.integers(1, 10000)), rng), "table", accelerometer, gyroscope, profile.clock
    )
    recording, truth = simulate(scenario, seed * 1000 + k)
    return recording, truth.gravity_m_s2


def flickering(k: int, seed: int) -> tuple[Recording, float]:
    """The same with consumer 1/f noise, through a file as a user's."""
    columns, _ = draw("none", seed * 1000 + k, 1.0, False, True, [])
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        pl.DataFrame(columns).write_csv(log)
        return trihedron.read(log), G


def statistics(recording: Recording, gravity: float) -> Iterator[Row]:
    """Every statistic of one session, by the model before any effect."""
    segments = segments_of(None, recording)
    calibration = trihedron.calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration
    obs = observe(recording, segments)
    context = begin(obs, start_twin(obs, calibration), None).context
    step_s = 1.0 / recording.rate_hz
    for name, zero in zip(("accelerometer", "gyro"), hidden_zeros(context.fitted), strict=True):
        if zero is not None and zero.is_at_edge:
            yield f"walk of the {name} at its edge, over the error of a pose", AT_EDGE, zero.rms / zero.noise
    yield "lost samples found", 0.0, float(len(find_losses(context)))
    value, spread, _ = common_time_error(step_errors(context), step_s)
    yield "common time error over its standard error", 5.0, value / spread
    yield "jitter in steps", 0.01, float(np.sqrt(max(value, 0.0) / STEP_FACTOR)) / step_s
    power = context.hold_power.sum(axis=1)
    yield "most powerful pose over the median", 1.5, float(power.max() / np.median(power))
    excess = context.vibration_power[: obs.n_holds].sum(axis=1)
    yield "90 % point over median of the poses' excess power", 3.0, float(np.quantile(excess, 0.9) / np.median(excess))
    yield "lines named in the holds", 0.0, float(len(find_lines(obs)))
    scatter = hold_scatter(obs)
    yield "largest ratio of a pose's variance", 3.0, float(np.nanmax(scatter.ratio))
    yield (
        "-log10 of the smallest corrected p-value of a pose",
        6.0,
        -float(np.log10(max(np.nanmin(scatter.p_value) * scatter.p_value.size, 1e-300))),
    )
    turns = table_turns(context)
    if not TableTilt().unavailable(context):
        errors, sigmas = _without_common_scale(context, turns)
        yield "largest error of a table turn over its sigma", 4.0, float(np.abs(errors / sigmas).max())
        yield (
            "-log10 p of all table turns",
            4.0,
            -float(np.log10(max(chdtrc(len(errors), ((errors / sigmas) ** 2).sum()), 1e-300))),
        )
        yield "table tilts named", 0.0, float(TableTilt().find(context) is not None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--sessions", type=int, default=60)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--flicker", action="store_true", help="sessions of another generator, with consumer 1/f noise")
    options = parser.parse_args()
    made = flickering if options.flicker else healthy
    values: dict[tuple[str, float], list[float]] = defaultdict(list)
    for k in range(options.sessions):
        for name, limit, value in statistics(*made(k, options.seed)):
            values[name, limit].append(value)
    print(f"{'statistic':54}{'limit':>8}{'n':>5}{'median':>9}{'95 %':>9}{'most':>9}{'over':>6}  rate at most (95 %)")
    for (name, limit), seen in values.items():
        over, n = sum(v > limit for v in seen), len(seen)
        most = float(beta.ppf(0.95, over + 1, n - over)) if over < n else 1.0
        spots = np.quantile(seen, [0.5, 0.95, 1.0])
        print(f"{name:54}{limit:8.3g}{n:5}" + "".join(f"{v:9.3g}" for v in spots) + f"{over:6}  {most:.3f}")


if __name__ == "__main__":
    main()
