"""What an ADC hides of a gyro: readings at its limit, moves inside an LSB, turns at a rate misread all along."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import trihedron
from diagnosed_session import unit_of
from hand_made_sessions import G, Instrument, recorded
from trihedron import _core, calibrate
from trihedron.estimate.accelerometer.faces import calibrate_faces
from trihedron.estimate.gyroscope.measurements import bridge_clipping, rate_noise_density
from trihedron.estimate.gyroscope.stated_turns import measured_turns
from trihedron.records import Calibration, Move, Recording, SensorCalibration
from trihedron.segment.means import BIAS_VARIANCE, NOISE_TRIED
from trihedron.session.rounding import STEADY
from trihedron.simulate import hand_session, simulate
from trihedron.units import RateUnit

RATE_HZ = 100.0
DEG = np.pi / 180.0
POSE_S = 3.0
SLOW = ((True, 1.0), (False, 4.0), (True, 4.0), (False, 1.0))


def turns(rng, n_moves=18, peak=12000.0, tremor=120.0, noise=3.0):
    """Counts (n, 3) of bumps with a tremor upon them between rests, as a 16-bit ADC gives them."""
    t = np.arange(0.0, 2.0, 1.0 / RATE_HZ)
    parts = []
    for _ in range(n_moves):
        bump = 16.0 * (t / 2.0) ** 2 * (1.0 - t / 2.0) ** 2
        shake = bump * tremor * np.sin(2 * np.pi * (rng.uniform(6.0, 11.0) * t + rng.uniform()))
        parts += [bump[:, None] * rng.normal(size=3) * peak / 2.0 + shake[:, None], np.zeros((400, 3))]
    values = np.concatenate(parts)
    return np.round(values + noise * rng.normal(size=values.shape))


def n_clipped(readings):
    """Number of gyro readings (n, 3) at a range limit."""
    rows = np.arange(len(readings))
    return bridge_clipping(Recording(rows / RATE_HZ, None, readings, RATE_HZ), rows)[2].sum()


def test_a_pair_at_the_end_of_the_codes_is_a_limit_and_elsewhere_is_none():
    bump = turns(np.random.default_rng(4), n_moves=4, peak=3000.0)
    # A move of a quarter of a second of which two samples are beyond the end: as brisk hands do.
    bump[400:407, 1] = [9000.0, 20000.0, 31000.0, 32767.0, 32767.0, 30000.0, 18000.0]
    bump[500:506, 1] = [-5000.0, -19000.0, -22000.0, -22000.0, -18000.0, -3000.0]
    elsewhere = bump.copy()
    elsewhere[403:405, 1] = 32701.0
    for counts, n in ((bump, 2), (elsewhere, 0)):
        assert n_clipped(counts) == n


@pytest.mark.parametrize(("pose_s", "ramp_s"), [(0.5, 0.05), (3.0, 0.3)])
def test_a_steady_turn_of_a_table_under_a_coarse_converter_is_not_at_a_limit(pose_s, ramp_s):
    # Of these, 9 to 20 in 20 were taken for a limit while only the axis itself was looked at.
    for seed in range(20):
        rng = np.random.default_rng([6, seed])
        quantum = rng.choice([0.5, 1.0, 4.0])
        # At a few rates [deg/s], the table's axis not quite the gyro's z; noise far below a code.
        parts, n_turns = [np.zeros(200)], rng.integers(1, 7)
        for _ in range(n_turns):
            ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(round(ramp_s * RATE_HZ)) + 0.5) / round(ramp_s * RATE_HZ))
            turned = np.concatenate([ramp, np.ones(round(pose_s * RATE_HZ * rng.uniform(0.7, 1.4))), ramp[::-1]])
            parts += [rng.uniform(20, 120) * rng.choice([-1, 1]) * turned, np.zeros(200)]
        rate = np.outer(np.concatenate(parts), [0.05, -0.1, 1.0]) + rng.uniform(-2.0, 2.0, 3)
        codes = np.round((rate + 0.02 * rng.normal(size=rate.shape)) / quantum) * quantum
        assert n_clipped(codes) == 0, seed


def test_hands_beyond_the_limit_of_a_coarse_converter_are_seen_still():
    t = np.arange(0.0, 2.0, 1.0 / RATE_HZ)
    bump = 16.0 * (t / 2.0) ** 2 * (1.0 - t / 2.0) ** 2
    for seed in range(20):
        rng = np.random.default_rng([7, seed])
        parts = []
        for _ in range(12):
            along = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1]) + 0.1 * rng.normal(size=3)
            shake = 2.0 * bump * np.sin(2 * np.pi * (rng.uniform(3, 9) * t + rng.uniform()))
            parts += [180.0 * bump[:, None] * along + shake[:, None], np.zeros((300, 3))]
        rate = np.concatenate(parts) + rng.uniform(-2.0, 2.0, 3)
        codes = np.clip(np.round((rate + 0.02 * rng.normal(size=rate.shape)) / 0.5) * 0.5, -100.0, 100.0)
        assert n_clipped(codes) > 0, seed


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("ways", [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)])
def test_settling_inside_a_step_is_charged_whichever_way_the_moves_go(noise, ways):
    rng = np.random.default_rng(7)
    scores = []
    for _ in range(200):
        # Hidden angle of one rest's two ends in the standard errors charged for it; the body settles exponentially.
        n = np.arange(400)
        zero, tau = rng.uniform(-0.5, 0.5), rng.uniform(10.0, 40.0)
        into, out_of = ways
        rate = np.concatenate([into * 60.0 * np.exp(-n / tau), out_of * 60.0 * np.exp(-n[::-1] / tau)])
        codes = np.round(rate + zero + noise * rng.normal(size=len(rate)))
        three = np.repeat(codes[:, None], 3, 1)
        variance = _core.rounding_variance(three, (np.ones(3), np.zeros(3), np.array([True] * 3)), STEADY)[:, 0]
        for part, way in ((slice(0, 400), into), (slice(400, 800), out_of)):
            # What is turned below the edge of the step in which the bias lies is never read.
            is_hidden = np.abs(rate[part]) < 0.5 - way * zero
            scores.append(rate[part][is_hidden].sum() / np.sqrt(variance[part][is_hidden].sum() + 1e-9))
    scores = np.array(scores)
    # A tail e exp(-t/τ) below an edge e that may be anywhere in the step hides e τ, charged as if it were uniform.
    assert np.sqrt(np.mean(scores**2)) < 1.5
    assert np.abs(scores).max() < 6.0


def turned(recording, spans, static, angles, axes, scale):
    """S, b and their standard errors by turns in samples ``spans`` by ``angles`` [rad] about the body's ``axes``: on a
    prior of the bias at rest, of scales to 30 %, and of the share of other axes, which no turn shows, to 1 %."""
    moves = [Move(k, k, k + 1, a, b) for k, (a, b) in enumerate(spans)]
    known = list(zip(range(1, 1 + len(moves)), moves, angles, strict=True))
    turns = measured_turns(recording, known, np.eye(3)[axes], static, is_stated=True)
    rest_s = sum(recording.time_s[b - 1] - recording.time_s[a] for a, b in static)
    var_rate, lasts_s = rate_noise_density(recording, [[span] for span in static]) ** 2, turns.duration_s[0]
    spread = turns.variance[0] / lasts_s**2 - var_rate / lasts_s
    of_bias = var_rate / rest_s + spread / len(static) + np.sum(turns.hidden**2, axis=(0, 2))
    covariance = np.zeros((24, 24))
    covariance[12:21, 12:21] = scale**2 * np.diag(np.where(np.eye(3), 0.3, 1e-2).ravel() ** 2)
    # b = -S z: known as z is, whatever the scale.
    by_scale = -np.kron(np.eye(3), turns.bias)
    covariance[21:, 12:21] = by_scale @ covariance[12:21, 12:21]
    covariance[12:21, 21:] = covariance[21:, 12:21].T
    covariance[21:, 21:] = by_scale @ covariance[12:21, 21:] + scale**2 * np.diag(of_bias)
    sensors = [
        SensorCalibration(s * np.eye(3), b, covariance[at : at + 12, at : at + 12], "counts", unit, "prior")
        for s, b, at, unit in ((1.0, np.zeros(3), 0, "m/s^2"), (scale, -scale * turns.bias, 12, "rad/s"))
    ]
    known = Calibration(*sensors, covariance, "case", 9.81, "assumed")
    found = turns.rates().scattered_on(known)
    sigma = np.sqrt(np.diag(found.covariance))
    return found.values[12:21].reshape(3, 3), found.values[21:], sigma[12:21].reshape(3, 3), sigma[21:]


@pytest.mark.parametrize(
    ("is_table", "step", "logs"),
    [(True, 4.0, 12), (False, 1.0, 12), *(pytest.param(*o, 25, marks=pytest.mark.slow) for o in SLOW)],
)
def test_known_turns_of_a_coarse_gyro_lie_within_their_error_bars(step, is_table, logs):
    rng = np.random.default_rng([31, round(step), is_table])
    scores = []
    for _ in range(logs):
        # Readings [deg/s] of twelve half turns at a steady rate, there and back twice about each axis.
        mix, zero = np.eye(3) + 0.01 * rng.normal(size=(3, 3)), rng.normal(size=3) * 3.0
        rates, turns, at = [np.zeros((round(POSE_S * RATE_HZ), 3))], [], round(POSE_S * RATE_HZ)
        for axis in range(3):
            for sense in (1.0, -1.0, -1.0, 1.0):
                peak = 60.0 * (1.0 if is_table else rng.uniform(0.7, 1.4))
                ramp = np.linspace(0.0, 1.0, 12, endpoint=False)
                n = round(180.0 / peak * RATE_HZ) - len(ramp)
                shape = np.concatenate([ramp, np.ones(n), 1.0 - ramp])
                shape *= sense * 180.0 * RATE_HZ / shape.sum()
                rates += [shape[:, None] * np.eye(3)[axis], np.zeros((round(POSE_S * RATE_HZ), 3))]
                turns.append((at - 5, at + len(shape) + 5, axis, sense * np.pi))
                at += len(shape) + len(rates[-1])
        rates = np.concatenate(rates)
        seen = step * np.round((rates @ mix.T + zero + 0.05 * rng.normal(size=rates.shape)) / step)
        edges = [0, *(x for turn in turns for x in turn[:2]), len(rates)]
        zeros = list(zip(edges[::2], edges[1::2], strict=True))
        recording = Recording(np.arange(len(seen)) / RATE_HZ, None, seen, RATE_HZ, "counts", "deg/s")
        back = np.linalg.inv(mix)
        S, b = back * DEG, -back @ zero * DEG
        *spans, axes, angles = zip(*turns, strict=True)
        found = turned(recording, list(zip(*spans, strict=True)), zeros, angles, list(axes), DEG)
        scores.append([*np.diag((found[0] - S) / found[2]), *((found[1] - b) / found[3])])
    scores = np.array(scores)
    # Errors of steps are uniform, few at a time: fewer than normal ones lie outside. Six scores a log, those of one
    # axis related: four binomial deviations below 95 %. Without shared errors: rms 20 (S), 40 (b).
    assert np.mean(np.abs(scores) < 1.96) > 0.90
    assert np.sqrt(np.mean(scores[:, :3] ** 2)) > 0.2
    assert np.abs(scores).max() < 5.0


@pytest.mark.parametrize("logs", [6, pytest.param(60, marks=pytest.mark.slow)])
def test_faces_of_a_coarse_accelerometer_lie_within_their_error_bars(logs):
    rng = np.random.default_rng(17)
    scores = []
    faces = np.repeat([1, -1, 2, -2, 3, -3], 3)
    part = float(np.interp(0.1, NOISE_TRIED, BIAS_VARIANCE))
    for _ in range(logs):
        S_a = np.diag([13.0, 13.1, 12.9]) @ (np.eye(3) + 0.01 * rng.normal(size=(3, 3)))
        zero = rng.normal(size=3) * 5.0
        f = 9.81 * np.sign(faces)[:, None] * np.eye(3)[np.abs(faces) - 1]
        lean = 0.2 * rng.normal(size=(6, 2, 3)) * (f[::3, None] == 0.0)
        f += lean[:, [0, 1, 0]].reshape(18, 3)
        values = np.array([np.round(p + 0.1 * rng.normal(size=(400, 3))).mean(axis=0) for p in f @ S_a.T + zero])
        found, _ = calibrate_faces(values, np.full(3, np.sqrt(part)), 9.81, up=faces.tolist(), shared=np.full(3, part))
        S = np.linalg.inv(S_a)
        # The zero: no lean of a table reaches it, each face stands as it happens to.
        scores.append(((found.S - S) / found.sigma_S)[np.diag_indices(3)])
    # Three scores of scales a log, uniform errors of two faces each: fewer are inside once in a hundred runs.
    assert np.sum(np.abs(scores) < 1.96) >= binom.ppf(0.01, 3 * logs, 0.95)
    assert np.sqrt(np.mean(np.square(scores))) < 1.2


def test_a_gyro_that_clipped_in_most_moves_is_left_out_for_that_reason():
    log = recorded(Instrument(), 3)
    # Counts, so that no unit determines a start; a limit that most moves of 1.1 to 2.6 rad in 1.5 s exceed.
    counts = np.round(1e4 * np.clip(log.gyroscope, -0.4, 0.4))
    clipped = replace(log, gyroscope=counts, gyroscope_unit=RateUnit.COUNTS)
    left_out = [f for f in calibrate(clipped, gravity_m_s2=G).findings if f.code == "gyroscope-left-out"]
    assert left_out[0].numbers["n_lost"] > 0.5 * left_out[0].numbers["n_moves"]


def test_a_right_calibration_is_verified_by_moves_whose_peaks_are_bridged():
    right = calibrate(recorded(Instrument(), 3), gravity_m_s2=G)
    log = recorded(Instrument(), 4, move_s=0.3, rate_hz=100.0)
    limit = 0.6 * np.abs(log.gyroscope).max()
    assert trihedron.verify(right, replace(log, gyroscope=np.clip(log.gyroscope, -limit, limit))).is_passed


def test_a_range_limit_met_in_every_move_is_the_physics_that_is_missing():
    log, _ = simulate(unit_of(hand_session(12, pose_s=2.5, layout=1), 77, is_wide=True), 3)
    limit = 0.3 * np.abs(log.gyroscope).max()
    clipped = replace(log, gyroscope=np.clip(log.gyroscope, -limit, limit))
    found = trihedron.diagnose(clipped, gravity_m_s2=9.80665)
    assert found.verdict == "missing-physics"
    assert [effect.id for effect in found.effects] == ["gyro-saturation"]
    of_codes = [abs(p.value) for p in found.effects[0].parameters if p.name.startswith("raw_")]
    # Codes are written with nine decimals.
    assert of_codes == pytest.approx([limit] * len(of_codes), abs=1e-8)
