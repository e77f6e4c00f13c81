"""Misses of the second blind trial (benches/blind_nuisances.py), one small case for each cause that was mended."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.channel_facts.limits import find_limits
from trihedron.diagnose.effects import lever_arm
from trihedron.diagnose.effects.lever_arm import LeverArm
from trihedron.diagnose.sample_evidence import _changed
from trihedron.segment import resegment, segment_recording
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate

STEP = 0.002


def peaks(rng, limit, n=6000):
    """(n, 3) readings whose channels reach their own heights, on a converter's steps, stopped at ``limit``."""
    t = np.arange(n) / 100.0
    x = np.stack(
        [height * np.sin(2.0 * np.pi * f * t) for height, f in ((3.0, 0.31), (2.6, 0.43), (2.2, 0.37))], axis=1
    )
    x += 0.3 * np.sin(2.0 * np.pi * 0.017 * t)[:, None] + rng.normal(0.0, 0.01, x.shape)
    return np.round(np.clip(x, -limit, limit) / STEP) * STEP


@pytest.mark.parametrize("seed", range(4))
def test_a_range_that_stops_a_few_readings_is_seen_and_one_that_stops_none_is_not(seed):
    rng = np.random.default_rng(seed)
    free = peaks(rng, 99.0)
    # Peaks of two to six readings above the limit: too short for a plateau of its own.
    limit = np.round((np.sort(np.abs(free).ravel())[-12] - 0.004) / STEP) * STEP
    sigma, step = np.full(3, 0.01), np.full(3, STEP)
    assert not find_limits(free, sigma, step)
    limits = find_limits(np.clip(free, -limit, limit), sigma, step)
    assert limits
    assert all(abs(abs(one.value) - limit) < 1e-9 for one in limits)


def hand(rng, arm, n_moves=24, rate_hz=100.0):
    """Context of moves that turn at random and travel besides, more in some than in others."""
    t = np.arange(120) / rate_hz
    window = np.sin(np.pi * t / t[-1]) ** 2
    rates, forces = [], []
    for _ in range(n_moves):
        w = window[:, None] * rng.normal(0.0, 2.0, 3) + (window * np.cos(3.0 * t))[:, None] * rng.normal(0.0, 1.0, 3)
        a = np.gradient(w, t, axis=0)
        travel = np.exp(rng.normal(0.0, 0.8)) * 0.3 * window[:, None] * rng.normal(size=3)
        forces.append(np.cross(a, arm) + np.cross(w, np.cross(w, arm)) + travel + rng.normal(0.0, 0.02, (len(t), 3)))
        rates.append(w)
    n = n_moves * len(t)
    return SimpleNamespace(
        moves=tuple(slice(k * len(t), (k + 1) * len(t)) for k in range(n_moves)), time_s=np.arange(n) / rate_hz,
        rate=np.concatenate(rates), force=np.concatenate(forces), gravity_in_moves=np.zeros((n, 3)),
        fitted=SimpleNamespace(line=SimpleNamespace(path=SimpleNamespace(attitude=np.tile(np.eye(3), (n, 1, 1))))),
        noise_floor=np.full((2, 3), 0.02), obs=SimpleNamespace(
            recording=SimpleNamespace(rate_hz=rate_hz), n=n, n_holds=0,
            move_ranges=tuple((k * len(t), (k + 1) * len(t)) for k in range(n_moves)),
        ),
    )  # fmt: skip


@pytest.fixture
def unclipped(monkeypatch):
    monkeypatch.setattr(lever_arm, "clipped_samples", lambda obs: np.zeros(obs.n, dtype=bool))


@pytest.mark.usefixtures("unclipped")
def test_an_arm_is_found_among_the_travel_of_a_hand_and_its_error_covers_it():
    arm, z, found = np.array([0.02, -0.03, 0.03]), [], 0
    for seed in range(12):
        evidence = LeverArm().find(hand(np.random.default_rng(seed), arm))
        if evidence is not None:
            found += 1
            z += [(p.value - v) / p.std for p, v in zip(evidence.parameters, arm, strict=True)]
        assert LeverArm().find(hand(np.random.default_rng(1000 + seed), np.zeros(3))) is None
    assert found >= 10
    # 36 values; the jackknife over 24 moves knows its error to 15 %.
    assert 0.6 < np.std(z) < 1.4


def small_session(seed=3, hold_s=3.0):
    profile = profile_by_name("adis")
    accelerometer, gyroscope = profile.unit(seed)
    motion = hand_session(14, hold_s=hold_s, move_s=1.5, first_hold_s=5.0, layout=seed)
    return simulate(Scenario(motion, "session", accelerometer, gyroscope, profile.clock), seed)


def test_samples_are_put_back_before_moves_are_left_out():
    def put_back(old):
        return replace(old, move_ranges=((0, 60), (70, 120), (130, 180)), move_holds=((0, 1), (1, 2), (2, 3)))

    def left_out(old):
        return replace(old, move_ranges=old.move_ranges[:1], move_holds=old.move_holds[:1])

    @dataclass(frozen=True)
    class Observed:
        move_ranges: tuple = ((0, 50), (60, 110), (120, 170))
        move_holds: tuple = ((0, 1), (1, 2), (2, 3))

    clipped = SimpleNamespace(reweigh=left_out, touched=None)
    lost = SimpleNamespace(reweigh=put_back, touched=(0,))
    for order in ([clipped, lost], [lost, clipped]):
        assert _changed(Observed(), order).move_ranges == ((0, 60),)


def test_a_short_pose_on_a_machine_that_shakes_is_a_pose():
    recording, truth = small_session(hold_s=1.4)
    part = [p for p in truth.segments if p.kind == "hold"][6]
    t = recording.time_s[part.start : part.stop] - recording.time_s[part.start]
    force = recording.accelerometer.copy()
    unit = np.linalg.norm(np.asarray(truth.accelerometer_S), axis=0).mean()
    shaking = np.sin(2.0 * np.pi * 0.23 * recording.rate_hz * t)[:, None] * np.array([0.8, -0.5, 0.6]) / unit
    force[part.start : part.stop] += shaking
    shaken = replace(recording, accelerometer=force)
    holds = resegment(shaken, segment_recording(shaken)).holds
    middle = 0.5 * (part.start + part.stop)
    assert any(hold.start < middle < hold.stop for hold in holds)
