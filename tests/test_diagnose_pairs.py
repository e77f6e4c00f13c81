"""What blind pairs with nuisances showed (benches/blind_pairs.py), one small case for each cause that was mended."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np

import trihedron
from trihedron.diagnose.against.mechanisms import compare_effects
from trihedron.records.diagnosis import AcceptedEffect, Candidate, EffectParameter
from trihedron.records.domains import HeldOut
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.profiles import profile_by_name


def effect(effect_id, before=0.014, after=0.002, *, domain="static-accel", share=0.9, variant="linear"):
    parameter = EffectParameter("bias_per_kelvin_x", 0.01, 3e-4, "m/s^2/K")
    held = (HeldOut(domain, 50.0, 1.0, before, after, "m/s^2"),)
    return AcceptedEffect(effect_id, "Said.", (parameter,), 0.0, 99.0, held, model={"variant": variant}, share=share)


def found(*effects, candidates=()):
    return SimpleNamespace(effects=effects, candidates=candidates, domains=(), remaining=())


def test_a_drift_that_scatter_spoils_is_named_beside_it_and_before_it():
    profile = profile_by_name("mpu")
    accel, gyro = profile.unit(7)
    gyro = replace(gyro, S=tuple(tuple(2.0 * v for v in row) for row in gyro.S))
    motion = hand_session(20, pose_s=4.0, layout=5)
    plain = Scenario(motion, "unit", accel, gyro, profile.clock)
    # Half of what the biases do is the scatter: without it in the noise, a drift does not remove half of their misfit.
    size = np.radians(0.1)
    flawed = with_effect(plain, "gyro-bias-drift", amplitude=(size, -size, size), tau_s=80.0)
    recording = simulate(flawed, 11)[0]
    # Zeros of the gyro that are others in every pose, in its raw unit.
    rng = np.random.default_rng(3)
    rates = np.array(recording.gyroscope)
    poses = trihedron.segment(recording).poses
    edges = [0, *[(a.stop + b.start) // 2 for a, b in pairwise(poses)], len(rates)]
    for first, last in pairwise(edges):
        rates[first:last] += 0.03 * 65.5 * rng.standard_normal(3)
    found = trihedron.diagnose(replace(recording, gyroscope=rates), gravity_m_s2=9.80665)
    assert [one.id for one in found.effects] == ["gyro-bias-drift", "gyro-bias-repeatability"]
    assert found.verdict == "missing-physics"


def test_pushed_poses_and_faint_lines_are_no_physics_that_a_simulation_lacks():
    pushed = effect("disturbed-pose", share=0.7, variant="")
    faint = effect("periodic-interference", share=0.05, variant="")
    strong = effect("periodic-interference", share=0.25, variant="")
    assert not compare_effects([], found(pushed, faint), alpha=0.01).differ
    assert compare_effects([], found(pushed, strong), alpha=0.01).differ
    assert compare_effects([], found(pushed, effect("accel-cubic")), alpha=0.01).differ
    # What only the model has is no footnote of the recording.
    tried = [Candidate("periodic-interference", 0.4, True)]
    assert compare_effects([faint], found(candidates=tried), alpha=0.01).differ


def test_few_poses_of_another_unit_are_numbers_beside_an_ideal_simulation_and_no_physics():
    profile = profile_by_name("mpu")
    accel, gyro = profile.unit(31)
    # Six poses of one half: what is open stays open, and the simulation's numbers are no knowledge of this unit's.
    few = Scenario(hand_session(9, pose_s=4.0, layout=11), "few", accel, gyro, profile.clock)
    recording, _ = simulate(few, 3)
    plain = Scenario(hand_session(9, pose_s=4.0, layout=12), "data sheet", profile.accelerometer, profile.gyroscope)
    found = trihedron.diagnose(recording, against=simulate(plain, 4)[0], gravity_m_s2=9.80665)
    assert not [one.id for one in found.effects]
    assert found.parameters
    assert found.verdict == "parameters-differ"
