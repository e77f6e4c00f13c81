"""Effects as curves over what drives them, in words that the catalogue holds, and as empirical relations."""

import ast
import inspect
import re
import textwrap
from dataclasses import replace

import numpy as np
import pytest
from catalogues import effects_page
from scipy.spatial.transform import Rotation

from diagnosed_session import diagnosed, nearest_pose, simulated
from test_architecture import PACKAGE, nodes
from trihedron.api.diagnosing import diagnose
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import Effect, Variant
from trihedron.diagnose.effects.earth_rate import EarthRate, nearest_turning
from trihedron.diagnose.session.solve import Distortion
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.report.effects.catalogue import CATALOGUE, REASONS
from trihedron.report.findings.wording import places

G = 9.80665
DEG = np.pi / 180.0


@pytest.mark.parametrize(
    ("effect_id", "size", "driver", "is_relative"),
    [
        ("accel-thermal-scale", {"per_k": (1e-3, -1e-3, 2e-3)}, "temperature", True),
        pytest.param(
            "vibration-rectification", {"sensor": "accelerometer", "coefficient": 0.02}, "vibration", False,
            marks=pytest.mark.slow,
        ),
        ("accel-quadratic", {"k2": (6e-4, -4e-4, 4e-4)}, "force", False),
    ],
)  # fmt: skip
def test_what_drives_an_effect_is_found_from_its_columns(effect_id, size, driver, is_relative):
    found = diagnosed(effect_id, n_poses=18, **size)
    effect = next(effect for effect in found.effects if effect.id == effect_id)
    curves = effect.curves
    seen = [(c.sensor, c.axis, c.driver, c.is_relative) for c in curves]
    assert seen == [("accelerometer", j, driver, is_relative) for j in range(3)]
    for j, curve in enumerate(curves):
        left = curve.data - np.interp(curve.data_x, curve.x, curve.value)
        # Half of what it adds: the weakest of these is a few times the noise of a pose.
        assert np.std(left) < 0.5 * np.ptp(curve.value)
        assert len(curve.data) == len(curve.poses) >= 6
        if driver == "force":
            k2 = size["k2"][j]
            assert curve.driver_axis == j
            # What was put in, to three of the curve's own standard errors and the width of a bin.
            assert np.all(np.abs(curve.value - k2 * curve.x**2) < 3.5 * curve.sigma + 0.01 * abs(k2) * G**2)
            # A pose shows 2 to 5 mm/s^2 beside the curve; it bends by 40 and more.
            assert np.std(left) < 0.2 * abs(k2) * G**2
    if effect_id == "accel-quadratic":
        z = [(p.value - k2) / p.std for p, k2 in zip(effect.parameters, size["k2"], strict=True)]
        # Three standard normal numbers: 4 sigma is passed by chance once in 5000 runs.
        assert np.max(np.abs(z)) < 4.0
        assert effect.held_out[0].chi2_per_dof_after < 1.3 < effect.held_out[0].chi2_per_dof_before


def turning(latitude, azimuth):
    level = np.cos(latitude)
    return EARTH_RATE_RAD_S * np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(latitude)])


@pytest.mark.parametrize("sigma", [(1e-8, 1e-8, 1e-8), (2e-6, 2e-6, 5e-6), (8e-6, 8e-6, 1e-3)])
def test_errors_of_latitude_and_north_are_those_they_say(sigma):
    rng = np.random.default_rng(4)
    z = []
    for _ in range(60):
        latitude, azimuth = rng.uniform(0.25, 1.0), rng.uniform(-3.0, 3.0)
        near = nearest_turning(turning(latitude, azimuth) + sigma * rng.normal(size=3), np.diag(np.square(sigma)))
        # With the vertical part unknown the hemisphere is a guess.
        z.append([
            (abs(near.latitude) - latitude) / near.latitude_std,
            np.angle(np.exp(1j * (near.azimuth - azimuth))) / near.azimuth_std,
        ])  # fmt: skip
    # 120 draws, two sigma: 95.4 % expected, 88 % four standard deviations below.
    assert np.mean(np.abs(z) < 2.0) > 0.88


def test_a_vector_that_is_not_the_earths_is_not_called_so():
    effect, sigma = EarthRate(), np.diag(np.square([3e-6, 3e-6, 3e-6]))
    at_home, here = Variant(Distortion(None, None), ("x", "y", "z"), ("rad/s",) * 3), np.radians(35.0)
    assert effect.is_plausible(at_home, turning(here, 1.0), sigma)
    assert effect.is_plausible(at_home, turning(-here, 1.0), sigma)
    assert not effect.is_plausible(at_home, 2.0 * turning(here, 1.0), sigma)
    assert not effect.is_plausible(at_home, 0.5 * turning(here, 1.0), sigma)


# Effects of the package: other tests may have added their own.
OURS = [effect for effect in catalogue() if type(effect).__module__.startswith("trihedron.")]


def cases_of(effect):
    """(case or None where only the run decides, names of the values) of every sentence that an effect can request."""
    for kind in type(effect).__mro__:
        if kind in (Effect, object) or not kind.__module__.startswith("trihedron.diagnose.effects"):
            continue
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(kind)))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "reported":
                case = node.args[0].value if isinstance(node.args[0], ast.Constant) else None
                yield case, {keyword.arg for keyword in node.keywords}


def test_every_effect_has_its_words_and_every_word_its_effect():
    assert set(CATALOGUE) == {effect.id for effect in OURS}
    assert all(entry.mechanism and entry.experiment for entry in CATALOGUE.values())
    assert set(re.findall(r"^## (\S+)$", effects_page(), re.MULTILINE)) == set(CATALOGUE)


def test_an_effect_asks_for_exactly_the_sentences_and_places_of_the_catalogue():
    asked = 0
    for effect in OURS:
        said, seen = dict(CATALOGUE[effect.id].said), set()
        for case, given in cases_of(effect):
            # A case that the run chooses: each that nothing else requests takes these values.
            for one in [case] if case else set(said):
                assert places(said[one]) == given, f"{effect.id} '{one}'"
                seen.add(one)
        assert seen == set(said), effect.id
        asked += len(seen)
    assert asked > 15


def test_every_reason_is_given_somewhere_and_with_its_places():
    given = {}
    for path in (PACKAGE / "diagnose").rglob("*.py"):
        for node in nodes(path):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "why_not":
                name = node.args[0].value
                given[name] = {keyword.arg for keyword in node.keywords}
                assert places(REASONS[name]) == given[name], f"{path.name}: {name}"
    assert set(given) == set(REASONS)


def session(seed, n_poses=30):
    """A healthy session: log, truth, (n,) number of the pose that a sample is nearest to, and how many there are."""
    log, truth = simulated(seed=seed, n_poses=n_poses, grade="adis")
    poses = [part for part in truth.segments if part.kind != "move"]
    return log, truth, nearest_pose(poses, log.n_samples), len(poses)


def added(log, truth, of_rate):
    """The log with ``of_rate`` (n, 3) rad/s in the gyro's readings."""
    return replace(log, gyroscope=log.gyroscope + of_rate @ np.linalg.inv(truth.gyroscope_S).T)


# A field whose horizontal part is a third of its vertical one is no g-sensitivity.
@pytest.mark.parametrize("field", [(0.8, 0.3, -0.5), pytest.param((1.2, 0.6, -3.76), marks=pytest.mark.slow)])
def test_a_field_in_the_room_is_unexplained_with_its_inclination_not_scatter(field):
    log, truth, _, _ = session(4, 18)
    vector = Rotation.from_quat(np.roll(truth.attitude, -1, axis=1)).inv().apply(field)
    log = added(log, truth, 0.05 * DEG * vector @ np.array([[1.0, 0.2, 0], [0, -0.8, 0.5], [0.3, 0, 0.9]]))
    result = diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert not {"gyro-bias-repeatability", "gyro-g-sensitivity"} & {effect.id for effect in result.effects}
    assert result.verdict == "unexplained"
    assert result.relations[0].depends_on == ("vector fixed in the world frame",)
    angle = next(p for p in result.relations[0].coefficients if p.unit == "deg")
    # The vector may as well point the other way, its coupling being reversed.
    true = np.degrees(np.arccos(field[2] / np.linalg.norm(field)))
    assert min(abs(angle.value - true), abs(180.0 - angle.value - true)) < 4.0 * angle.std


def test_a_gyro_that_averages_over_many_samples_lags_and_has_no_other_effect():
    log, truth, _, _ = session(7, 14)
    n = round(0.08 * log.rate_hz)
    before = np.concatenate([np.repeat(log.gyroscope[:1], n - 1, axis=0), log.gyroscope])
    mean = np.apply_along_axis(np.convolve, 0, before, np.full(n, 1.0 / n), mode="valid")
    result = diagnose(replace(log, gyroscope=mean), gravity_m_s2=truth.gravity_m_s2)
    (effect,) = result.effects
    # This noise hides what separates a running mean from a delay, a third of its lag squared.
    assert {effect.id, *effect.confounded_with} == {"sensor-lag", "accel-gyro-time-offset"}
    lag = effect.parameters[0]
    assert lag.name in ("gyro_lag", "accelerometer_delay")
    assert abs(abs(lag.value) - 0.5 * (n - 1) / log.rate_hz) < 4.0 * lag.std


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
    (size,) = (c for c in relation.coefficients if c.name.startswith("y"))
    assert abs(size.value - 0.03 * DEG) < 4.0 * size.std
