"""Laws of a misfit: found where they are, silent where they are not, and written out as an effect."""

import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trihedron.diagnose.laws.misfit import misfit_of
from trihedron.diagnose.laws.room import search_room
from trihedron.diagnose.laws.search import Candidate, search
from trihedron.diagnose.laws.written import effect_file
from trihedron.pipeline import diagnose
from trihedron.records.diagnosis import EffectParameter, Relation
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.text import to_text
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.profiles import profile_by_name

N = 30
DEG = np.pi / 180.0


def session(seed):
    """A healthy session: log, truth, (n,) number of the pose that a sample is nearest to, and how many there are."""
    profile = profile_by_name("adis")
    accelerometer, gyroscope = profile.unit(seed)
    log, truth = simulate(Scenario(hand_session(30, layout=seed), "", accelerometer, gyroscope, profile.clock), seed)
    poses = [(p.start, p.stop) for p in truth.segments if p.kind != "move"]
    middles = [(a[1] + b[0]) / 2 for a, b in pairwise(poses)]
    return log, truth, np.searchsorted(middles, np.arange(log.n_samples)), len(poses)


def added(log, truth, of_rate):
    """The log with ``of_rate`` (n, 3) rad/s in the gyro's readings."""
    return replace(log, gyroscope=log.gyroscope + of_rate @ np.linalg.inv(truth.gyroscope_S).T)


def misfit(y, slow=0.0):
    t = np.arange(N) / N
    V = np.eye(N) + slow * np.minimum.outer(t, t)
    return misfit_of(y, np.ones((N, 1)), V, np.arange(N))


def candidates(one, signals, *, is_smooth=False):
    return [
        Candidate("x", name, (name,), "1", one.columns(v[:, None]), lambda order, v=v: v[order][:, None], is_smooth)
        for name, v in signals.items()
    ]


def test_a_law_is_named_with_its_coefficient():
    rng = np.random.default_rng(3)
    signals = {name: rng.normal(size=N) for name in ("a", "b", "c", "d", "e")}
    one = misfit(3.0 * signals["b"] - 2.0 * signals["d"] + rng.normal(size=N))
    found = search(one, candidates(one, signals), 5)
    terms = {t.candidate.names[0]: (t.value[0], t.sigma[0]) for t in found.terms}
    assert set(terms) == {"b", "d"}
    for name, true in (("b", 3.0), ("d", -2.0)):
        assert abs(terms[name][0] - true) < 4.0 * terms[name][1]
    assert found.judged.share > 0.6


def test_no_law_is_found_in_scatter_however_large():
    found = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        signals = {str(k): rng.normal(size=N) for k in range(40)}
        one = misfit(20.0 * rng.normal(size=N))
        found += search(one, candidates(one, signals), 40) is not None
    # A false law in 1 % of sessions is promised: more than three in 60 come up once in 300 such runs.
    assert found <= 3


def test_what_drifts_is_not_taken_for_what_changes_slowly_too():
    false = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, 1])
        drift = 10.0 * np.cumsum(rng.normal(size=N))
        signal = np.cumsum(rng.normal(size=N))
        one = misfit(drift + rng.normal(size=N))
        false += search(one, candidates(one, {"T": signal}, is_smooth=True), 30) is not None
    # Two walks resemble each other more often than not: without the shift test a third of these get a law.
    assert false <= 2


def test_a_vector_fixed_in_the_room_is_found_with_its_inclination():
    rng = np.random.default_rng(8)
    q, _ = np.linalg.qr(rng.normal(size=(N, 3, 3)))
    room = q * np.sign(np.linalg.det(q))[:, None, None]
    m = np.array([np.sin(np.radians(68)) * 0.6, np.sin(np.radians(68)) * 0.8, np.cos(np.radians(68))])
    inside = room @ m
    K = rng.normal(size=(3, 3))
    misfits = tuple(misfit(5.0 * inside @ K[k] + rng.normal(size=N)) for k in range(3))
    law = search_room(misfits, room, 30)
    assert law is not None
    assert abs(law.inclination_deg - 68.0) < 4.0 * law.inclination_sigma_deg
    assert law.share > 0.7
    noise = tuple(misfit(5.0 * rng.normal(size=N)) for _ in range(3))
    assert search_room(noise, room, 30) is None
    gravity = tuple(misfit(5.0 * room[:, :, 2] @ K[k] + rng.normal(size=N)) for k in range(3))
    assert search_room(gravity, room, 30) is None


@pytest.mark.xfail(strict=False, reason="its size is what the 1/f noise inside the poses lets expect")
def test_zeros_that_scatter_are_named_and_sized_in_a_session():
    log, truth, pose, n_poses = session(2)
    rng = np.random.default_rng(21)
    log = added(log, truth, 0.02 * DEG * rng.normal(size=(n_poses, 3))[pose])
    result = diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert result.effects[0].id == "gyro-bias-repeatability"
    for p in result.effects[0].parameters:
        assert abs(p.value - 0.02 * DEG) < 4.0 * p.std
    assert not result.relations
    # The scale of the gyro is not pulled by biases that differ: a tenth of a per cent is three of its errors here.
    ratio = np.array(result.extended.gyroscope["S"]) @ np.linalg.inv(truth.gyroscope_S)
    sigma = np.linalg.norm(np.array(result.extended.gyroscope["sigma_S"])) / np.linalg.norm(truth.gyroscope_S)
    assert np.abs(np.linalg.svd(ratio)[1] - 1.0).max() < 5.0 * sigma + 1e-3


@pytest.mark.xfail(strict=False, reason="its size is what the 1/f noise inside the poses lets expect")
def test_a_field_in_the_room_is_unexplained_with_a_law_not_scatter():
    log, truth, _, _ = session(4)
    vector = Rotation.from_quat(np.roll(truth.attitude, -1, axis=1)).inv().apply([0.8, 0.3, -0.5])
    log = added(log, truth, 0.05 * DEG * vector @ np.array([[1.0, 0.2, 0], [0, -0.8, 0.5], [0.3, 0, 0.9]]))
    result = diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert "gyro-bias-repeatability" not in [effect.id for effect in result.effects]
    assert result.relations[0].depends_on == ("vector fixed in the room",)
    assert "fixed in the room" in to_text(diagnosis_report(result))


def test_a_law_is_written_out_as_an_effect_that_runs(tmp_path):
    law = Relation(
        "gyroscope", ("u_x u_y", "u_z^2"), "reading of x grows by c1·(u_x u_y) + c2·(u_z^2)",
        (EffectParameter("x: u_x u_y", 1e-3, 1e-4, "(rad/s)/(g^2)"),
         EffectParameter("z: u_z^2", 2e-3, 1e-4, "(rad/s)/(g^2)")),
        0.5, None, (), "hold edges", "The gyro's zero (x, z) follows u_x u_y and u_z^2: 50 %.",
    )  # fmt: skip
    source = effect_file(law, "gyro-named-law")
    assert source is not None
    (tmp_path / "gyro_named_law.py").write_text(source)
    program = (
        "import numpy as np\nfrom types import SimpleNamespace as N\nimport gyro_named_law\n"
        "from trihedron.diagnose.effects import catalogue\n"
        "effect = next(e for e in catalogue() if e.id == 'gyro-named-law')\n"
        "f = np.array([[9.8, 0, 0], [6.0, 7.75, 0], [0, 0, 9.8]])\n"
        "c = N(force=f, rate=0 * f, n_points=3, gyro_axes=np.eye(3))\n"
        "columns = effect.variants(c)[0].distortion.rate\n"
        "print(columns[1, 0, 0] > 0.4, columns[2, 2, 1])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["True", "1.0"]
    past = Relation("gyroscope", ("previous u_x",), "", (EffectParameter("x: previous u_x", 1.0, 0.1, ""),), 0.5, None)
    assert effect_file(past) is None


def test_a_healthy_session_has_neither_scatter_nor_law():
    log, truth, _, _ = session(1)
    result = diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert result.verdict == "consistent"
    assert not result.relations
