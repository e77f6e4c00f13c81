"""Misses of the second blind trial (benches/blind_nuisances.py), one small case for each cause that was mended."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.channel_facts.limits import find_limits
from trihedron.diagnose.effects import lever_arm
from trihedron.diagnose.effects.contract import Variant, force_only, per_axis
from trihedron.diagnose.effects.disturbed_pose import DisturbedPose
from trihedron.diagnose.effects.lever_arm import LeverArm
from trihedron.diagnose.selection import prune
from trihedron.diagnose.selection.model import Accepted, begin, observed_with, with_only
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.starting_point import start_twin
from trihedron.diagnose.session.twin import Distortion
from trihedron.diagnose.zeros.levels import two_levels
from trihedron.pipeline.calibrating import calibrate
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


def test_an_effect_that_other_observations_do_not_show_goes_with_what_changed_them():
    recording, truth = small_session()
    segments = segment_recording(recording)
    calibration = calibrate(recording, segments=segments, gravity_m_s2=truth.gravity_m_s2).calibration
    obs = observe(recording, resegment(recording, segments))
    model = begin(obs, start_twin(obs, calibration), None)
    # A pose called pushed in changed observations, of which the bare ones know nothing.
    columns = np.zeros((model.context.n_points, 3, 3))
    columns[4] = np.eye(3)
    pushed = Variant(force_only(columns), per_axis("push"), ("m/s^2",) * 3, {"pose": (4.0, "index")}, "pose 4")
    plain = {"p_adjusted": 1e-9, "delta_bic": 99.0, "gain": 1.0, "held_out": ()}
    changes = Accepted(
        DisturbedPose(), None, SimpleNamespace(reweigh=lambda old: replace(old), variant=None, touched=None), **plain
    )
    one = Accepted(DisturbedPose(), pushed, None, **plain)
    left = with_only(replace(model, accepted=(changes, one)), (one,))
    assert left.accepted == ()
    assert left.fitted.twin.effect.size == 0


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
        assert observed_with(Observed(), order).move_ranges == ((0, 60),)


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


def test_zeros_that_take_two_values_are_told_from_zeros_that_scatter():
    rng = np.random.default_rng(7)
    two, scatter = 0, 0
    for _ in range(40):
        n = int(rng.integers(15, 40))
        noise = rng.normal(size=n)
        # A pose in three lies between the values: the zero jumped in it.
        between = np.where(rng.random(n) < 0.33, rng.uniform(-1.0, 1.0, n), rng.choice([-1.0, 1.0], n))
        two += two_levels(10.0 * between + noise, np.ones(n)).is_clear
        scatter += two_levels(rng.normal(0.0, 10.0, n) + noise, np.ones(n)).is_clear
    assert two >= 32
    # A g-sensitivity of poses that lie on faces has two values too, and gravity is known.
    faces = np.repeat([-1.0, 1.0], 10)
    assert two_levels(10.0 * faces + rng.normal(size=20), np.ones(20)).is_clear
    assert not two_levels(10.0 * faces + rng.normal(size=20), np.ones(20), faces[:, None]).is_clear
    # One normal session in some 500 (480 drawn): two of 40 are one chance in 300.
    assert scatter <= 1


def test_a_gyro_effect_that_leaves_gravity_unexplained_does_not_live_on_velocity(monkeypatch):
    before = {prune.STATIC_GYRO: (70.0, 67.0), prune.MOVES: (155.0, 41.0), prune.DYNAMICS: (96.0, 53.0)}
    after = {prune.STATIC_GYRO: (75.0, 67.0), prune.MOVES: (117.0, 41.0), prune.DYNAMICS: (57.0, 53.0)}
    monkeypatch.setattr(prune, "domain_chi2", lambda fitted: {"before": before, "after": after}[fitted])
    monkeypatch.setattr(prune, "in_the_scatter_of", lambda base, _fitted: base)  # nothing scatters
    column = np.ones((4, 3, 1))

    def against(force, rate):
        return SimpleNamespace(
            base="before", fitted="after", variant=SimpleNamespace(distortion=Distortion(force, rate))
        )

    assert not prune.explains(against(None, column))
    # A delay moves velocity alone, and gravity's misfit is another's.
    after[prune.MOVES] = (154.0, 41.0)
    assert prune.explains(against(None, column))
