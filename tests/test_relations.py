"""Relations outside the catalogue: found where they are, silent where they are not."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron.api.diagnosing import diagnose
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.text import to_text
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.profiles import profile_by_name

DEG = np.pi / 180.0


def session(seed, n_poses=30):
    """A healthy session: log, truth, (n,) number of the pose that a sample is nearest to, and how many there are."""
    profile = profile_by_name("adis")
    accelerometer, gyroscope = profile.unit(seed)
    log, truth = simulate(
        Scenario(hand_session(n_poses, layout=seed), "", accelerometer, gyroscope, profile.clock), seed
    )
    poses = [(p.start, p.stop) for p in truth.segments if p.kind != "move"]
    middles = [(a[1] + b[0]) / 2 for a, b in pairwise(poses)]
    return log, truth, np.searchsorted(middles, np.arange(log.n_samples)), len(poses)


def added(log, truth, of_rate):
    """The log with ``of_rate`` (n, 3) rad/s in the gyro's readings."""
    return replace(log, gyroscope=log.gyroscope + of_rate @ np.linalg.inv(truth.gyroscope_S).T)


def test_a_field_in_the_room_is_unexplained_with_its_inclination_not_scatter():
    log, truth, _, _ = session(4, 22)
    vector = Rotation.from_quat(np.roll(truth.attitude, -1, axis=1)).inv().apply([0.8, 0.3, -0.5])
    log = added(log, truth, 0.05 * DEG * vector @ np.array([[1.0, 0.2, 0], [0, -0.8, 0.5], [0.3, 0, 0.9]]))
    result = diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert "gyro-bias-repeatability" not in [effect.id for effect in result.effects]
    assert result.verdict == "unexplained"
    assert result.relations[0].depends_on == ("vector fixed in the world frame",)
    angle = next(p for p in result.relations[0].coefficients if p.unit == "deg")
    # The vector may as well point the other way, its coupling being reversed.
    true = np.degrees(np.arccos(-0.5 / np.sqrt(0.98)))
    assert min(abs(angle.value - true), abs(180.0 - angle.value - true)) < 4.0 * angle.std
    assert "fixed in the world frame" in to_text(diagnosis_report(result))


def test_a_bias_that_remembers_the_last_turn_is_said_so_with_its_size():
    log, truth, pose, n_poses = session(3)
    sign = np.random.default_rng(5).choice([-1.0, 1.0], n_poses)
    turn = np.zeros(n_poses)
    for part, nearest in ((p, pose[p.stop - 1]) for p in truth.segments if p.kind == "move"):
        turn[nearest] = np.sign(truth.angular_rate_rad_s[part.start : part.stop, 1].sum())
    of_rate = np.zeros((log.n_samples, 3))
    of_rate[:, 1] = 0.03 * DEG * np.where(turn == 0.0, sign, turn)[pose]
    result = diagnose(added(log, truth, of_rate), gravity_m_s2=truth.gravity_m_s2)
    assert result.verdict == "unexplained"
    (relation,) = result.relations
    assert relation.depends_on == ("sign of the last rotation about y",)
    assert relation.share > 0.1  # one axis of three follows it
    said = " ".join(to_text(diagnosis_report(result)).split())
    assert "the misfit follows sign of the last rotation about Y." in said
    (size,) = (c for c in relation.coefficients if c.name.startswith("y"))
    assert abs(size.value - 0.03 * DEG) < 4.0 * size.std
