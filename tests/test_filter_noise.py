"""Noise for a filter: strengths by evidence, errors on the half not seen, shares, rests, and what is written."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import trihedron
from reference_rig import FINE_HZ, G, forces, hand, rates_of
from trihedron.api.referring import motion_of
from trihedron.estimate.filter_noise import beside_reference as beside
from trihedron.estimate.filter_noise.beside_reference import ANGLE, independent_or_not, informed, parts_of
from trihedron.estimate.filter_noise.findings import noticed, too_sure, unlike_this_log
from trihedron.estimate.filter_noise.left_over import PARTS, drawn_errors, mean_square, of_temperature
from trihedron.estimate.filter_noise.strengths import Prior, _slope, bounded, fit, height, most_likely
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch, errors_over, parts_of_walk
from trihedron.estimate.filter_noise.stretches import bias_steps
from trihedron.files.formats.filter_noise import TARGETS, filter_noise_text
from trihedron.records import Recording, Severity
from trihedron.records.filter_noise import Bounded, Share, StaticNoise, TiltCheck
from trihedron.records.reference import ReferenceMotion
from trihedron.units import AccelerationUnit, RateUnit

EUROC = Path(__file__).parents[2] / "shared" / "data" / "euroc"
N, K, SLOW, TAU = 2e-4, 3e-5, 2e-3, 6.0
STRENGTHS = np.array([N, 0.0, K, 1e-5, SLOW, 0.0, TAU, 0.0])
HZ = 100.0


def still(m=60):
    """A stretch of a body that does not turn: means over blocks of a second, nothing constant but the start."""
    time, eye = np.arange(m) + 0.5, np.eye(3)
    steps = bias_steps(time[:, None, None] * eye)
    return Stretch(
        time, np.zeros(3 * m), np.tile(0.1 * eye, (m, 1)), np.eye(m), steps,
        None, np.tile(eye, (m, 1, 1)), np.zeros(m), parts_of_walk(m, is_triangle=False),
    )  # fmt: skip


def drawn(seed, m=60):
    """The same with errors of known strengths."""
    stretch = still(m)
    L, _ = stretch.factor(STRENGTHS)
    return replace(stretch, observed=L @ np.random.default_rng(seed).normal(size=3 * m))


def test_errors_are_as_large_as_predicted_when_the_strengths_are_right():
    nees = [errors_over([(drawn(seed), 30)], STRENGTHS[None], [5.0])[0].nees for seed in range(20)]
    # 20 runs of about five stretches apart: 3 with a standard error of sqrt(6/100) = 0.25.
    assert np.mean(nees) == pytest.approx(3.0, abs=0.8)
    plain = np.array([N, 0.0, K, 1e-5, 0.0, 0.0, 1.0, 0.0])
    assert errors_over([(drawn(0), 30)], plain[None], [5.0])[0].nees > 6.0


def test_strengths_lie_within_their_intervals():
    prior = Prior(
        np.log([2e-4, 1.0, 2e-5, 3e-5, 1e-3, 8.0, 1.0, 1.0]),
        np.log([1.1, 2.0, 30.0, 3.0, 30.0, 4.0, 2.0, 2.0]),
        np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0]),
    )
    found = fit([drawn(3)], prior)
    for name, true in (("noise", N), ("bias_walk", K), ("world", SLOW), ("slow_s", TAU)):
        low, high = np.quantile(found.draws[:, NAMES.index(name)], [0.005, 0.995])
        assert low < true < high, name
    assert np.all(found.draws[:, 1] == 0.0)
    assert found.is_settled
    assert not replace(found, n_effective=1.0).is_settled


def test_a_strength_that_is_nothing_has_an_interval_down_to_nothing():
    # Of a flat density from 0 to a limit a tenth lies below a tenth of the limit: a tail that a logarithm makes long.
    usual = replace(ANGLE, is_there=np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0]))
    draws = fit([drawn(4)], usual).draws
    walk = draws[:, NAMES.index("bias_walk")]
    white = draws[:, NAMES.index("white")]
    assert np.mean(white < 0.1 * np.quantile(white, 0.9)) > 0.05
    assert walk.min() < 0.05 * walk.max()
    # A slow error that lasts less than a block would be white error once more.
    assert draws[:, NAMES.index("slow_s")].min() >= 1.0


def test_the_size_of_a_bias_per_kelvin_is_found_with_the_other_strengths():
    kelvin = np.linspace(-2.0, 2.0, 60)
    stretch = replace(still(), kelvin=kelvin)
    warm = np.array([1.5e-3, -1e-3, 5e-4])
    # Of a bias that grows by 4/59 K a second the angle after h is h²/2 of it.
    true = np.sum(warm**2) * (4.0 / 59.0) ** 2 * 10.0**4 / 4.0
    ratios = []
    for seed in range(3):
        one = replace(stretch, observed=drawn(seed).observed + stretch.warmth @ warm)
        found = fit([one], informed(ANGLE, [one], None))
        assert np.median(found.draws[:, NAMES.index("per_kelvin")]) == pytest.approx(1e-3, rel=0.7)
        ratios.append(np.median(of_temperature([one], found, [10.0])[10.0]["temperature"]) / true)
    # Each is known to some 12 %.
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.25)


def test_a_reference_that_follows_the_sensor_does_not_lower_its_noise():
    # A quarter of the noise is left beside a smoother over the same gyro; its datum is good to five per cent.
    weak = STRENGTHS * [0.25, 1.0, 1.0, 1.0, 0.2, 1.0, 1.0, 1.0]
    stretch = still(100)
    L, _ = stretch.factor(weak)
    stretch = replace(stretch, observed=L @ np.random.default_rng(2).normal(size=300))
    static = StaticNoise(Bounded(N, 0.9 * N, 1.1 * N), Bounded(K, K, K))
    prior = informed(ANGLE, [stretch], static)
    plain = replace(prior, is_there=np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0]))
    fitted = independent_or_not([stretch], plain, ANGLE)
    assert fitted.follows
    assert np.median(fitted.draws[:, 0]) < 0.5 * N
    assert not independent_or_not([drawn(6)], plain, ANGLE).follows


def test_parts_of_an_error_are_the_textbook_ones():
    found = {name: value[0] for name, value in parts_of(STRENGTHS[None], 10.0).items()}
    assert found["static"] == pytest.approx(3 * N**2 * 10)
    assert found["bias"] == pytest.approx(K**2 * 1000)
    far = parts_of(STRENGTHS[None], 1e6)["reference"][0]
    assert far == pytest.approx(6 * SLOW**2, rel=1e-3)  # two errors that no longer know of each other
    # Of an error fixed in a body that has turned by half a turn two axes have changed sign: (2 σ)² each.
    fixed, half = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, SLOW, 1e6, 0.0]]), np.array([1.0, -1.0 / 3.0])
    assert parts_of(fixed, 10.0, alike=half)["reference"][0] == pytest.approx(8 * SLOW**2, rel=1e-3)


def before_a_tracker(seed, seconds):
    """A hand, noise and truth error known."""
    rng = np.random.default_rng(seed)
    t, C, _ = hand(rng, seconds)
    step = FINE_HZ // 100
    n = len(t) // step
    time = (np.arange(n) * step + (step - 1) / 2) / FINE_HZ
    w, f = (x[: n * step].reshape(n, step, 3).mean(axis=1) for x in (rates_of(C), forces(C)))
    w = w + 0.01 + N * 10 * rng.normal(size=w.shape)
    f = f + 0.01 * rng.normal(size=f.shape)
    log = Recording.from_arrays(time, f, w)
    k = np.arange(0, len(t), FINE_HZ // 50)
    return log, ReferenceMotion(t[k], attitude=C[k], source="tracker")


def resting(seed=1, seconds=120, n=N):
    rng = np.random.default_rng(seed)
    m = 100 * seconds
    force, rate = [0.0, 0.0, G] + 0.01 * rng.normal(size=(m, 3)), 10 * n * rng.normal(size=(m, 3))
    return Recording.from_arrays(np.arange(m) / 100.0, force, rate)


@pytest.fixture(scope="module")
def static(tmp_path_factory):
    path = tmp_path_factory.mktemp("static") / "allan.json"
    path.write_text(json.dumps(trihedron.allan(resting(9, seconds=600)).to_dict()))
    return path


@pytest.fixture(scope="module")
def found(static):
    log, truth = before_a_tracker(5, 70)
    return trihedron.filter_noise(log, static=static, reference=truth, horizons_s=[1, 10, 100], gravity_m_s2=G)


def test_a_healthy_gyro_before_a_good_truth_keeps_its_static_noise(found):
    gyro = found.sensor("gyroscope")
    assert found.sensor("accelerometer") is None  # a truth without position says nothing of velocity
    assert gyro.N.value == pytest.approx(N, rel=0.1)
    assert gyro.bias.kind == "walk"
    rest = next(s.share for s in gyro.shares if s.cause == "static" and s.horizon_s == 1.0)
    assert rest.upper > 0.5
    for one in gyro.consistency:
        assert 0.5 < one.nees < 9.0
    # A horizon longer than the log has no shares.
    assert {one.horizon_s for one in gyro.shares} == {1.0, 10.0}
    for h in (1.0, 10.0):
        middle = sum(s.share.value for s in gyro.shares if s.horizon_s == h)
        assert middle == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(
    ("change", "words", "is_said"),
    [
        ({"N": Bounded(N, N / 2.0, 2.0 * N)}, "filter-noise-uncertain", True),
        ({}, "filter-noise-uncertain", False),
        ({"N": Bounded(0.0, 0.0, 4.0 * N, True)}, "upper limit", True),
        ({"shares": (Share("reference", 10.0, Bounded(0.97, 0.87, 1.0)),)}, "what little remains", True),
        ({"shares": (Share("reference", 10.0, Bounded(0.8, 0.7, 1.0)),)}, "what little remains", False),
        ({"N": Bounded(N / 2.0, 0.45 * N, 0.6 * N, True), "static": None}, "filter-noise-below-quietest", True),
        ({"N": Bounded(N / 2.0, 0.45 * N, 0.6 * N, True), "static": None}, "filter-noise-uncertain", False),
        ({"N": Bounded(N, 0.9 * N, 1.1 * N), "static": None}, "filter-noise-below-quietest", False),
    ],
)
def test_an_n_that_is_uncertain_a_limit_the_references_or_below_the_quietest_is_said(found, change, words, is_said):
    # The least of some 60 estimates with a relative error of 5 % each.
    assert found.sensors[0].quietest == pytest.approx(N, rel=0.2)
    noticed_now = list(noticed(replace(found.sensors[0], **change)))
    assert any(words in f"{one.code} {one.seen}" for one in noticed_now) is is_said


def test_what_a_log_lacks_is_said_at_once():
    t = np.arange(6000) / 100.0
    swing = np.column_stack([np.sin(t), np.cos(1.3 * t), 0.1 * t])
    moving = Recording.from_arrays(t, swing + np.array([0.0, 0.0, G]), swing, gyroscope_unit="counts")
    still = replace(resting(3), accelerometer_unit=AccelerationUnit.COUNTS, gyroscope_unit=RateUnit.COUNTS)
    still = replace(still, source="still.csv")
    said = r"not static in it for 20 s.*reference.*is in counts.*`trihedron allan still.csv`"
    with pytest.raises(ValueError, match=said):
        trihedron.filter_noise(moving, static=trihedron.allan(still))


def both(found):
    """With an accelerometer as a position would give it."""
    b = Bounded(2e-3, 1e-3, 3e-3)
    sensor = replace(
        found.sensor("gyroscope"), sensor="accelerometer", unit="m/s^2", N=b, K=Bounded(0.0, 0.0, 4e-4, True),
        static=StaticNoise(b, b),
    )  # fmt: skip
    return replace(found, sensors=(found.sensors[0], sensor))


@pytest.mark.parametrize("target", TARGETS)
def test_every_consumer_gets_both_sensors_in_its_own_unit(found, target):
    whole = both(found)
    text = filter_noise_text(whole, target)
    gyro, rate = whole.sensors[0].N.filter_value, whole.rate_hz
    wanted = {"fast-lio": gyro**2 * rate, "robot_localization": gyro**2 * rate, "gtsam": gyro**2}.get(target, gyro)
    # Four digits, those of N before it is squared or after.
    numbers = [float(one) for one in re.findall(r"\d+\.\d+(?:e-\d+)?", text)]
    assert min(abs(one / wanted - 1.0) for one in numbers) < 1e-3
    assert f"static gyroscope: N {whole.sensors[0].static.N.value:.4g}" in text
    assert "accelerometer: N 0.002 (0.001 to 0.003) m/s^2/sqrt(Hz), K below 0.0004 m/s^2/sqrt(s)" in text
    if target not in ("gtsam", "basalt"):
        assert yaml.safe_load(text.replace("%YAML:1.0", ""))
    if target == "basalt":
        assert json.loads(text)["value0"]["accel_bias_std"] == [4e-4] * 3


def test_a_static_log_gives_back_the_static_values_with_a_factor_of_one():
    rest = trihedron.allan(resting(2))
    found = trihedron.filter_noise(resting(1), static=rest)
    gyro = found.sensor("gyroscope")
    assert gyro.static is not None
    assert gyro.N.value / gyro.static.N.value == pytest.approx(1.0, abs=0.04)
    assert gyro.N.lower < N < gyro.N.upper
    assert gyro.K.is_limit
    assert any(f.code == "filter-noise-static" for f in found.findings)


def test_without_a_reference_k_is_that_of_the_static_log_read_from_either_form(tmp_path):
    noise = trihedron.allan(resting(2, seconds=1200))
    path = tmp_path / "static.json"
    path.write_text(json.dumps(noise.to_dict()))
    by_result, by_file = (trihedron.filter_noise(resting(1), static=one) for one in (noise, path))
    for sensor in by_result.sensors:
        # Two minutes bound K of white noise some (20 min / 2 min)^(3/2) times as loosely as twenty.
        assert sensor.K == sensor.static.K
        assert sensor.K.upper < 0.2 * trihedron.filter_noise(resting(1)).sensor(sensor.sensor).K.upper
        assert by_file.sensor(sensor.sensor) == sensor
    assert "K of the gyroscope and accelerometer from" in " ".join(str(by_file).split())


def test_without_a_reference_tilt_and_bias_over_moves_are_shown_beside_what_noise_predicts():
    rest = trihedron.allan(resting(2))
    result = trihedron.filter_noise(turned_between_intervals(scale=1.02), static=rest)
    assert "the heading is not seen" in " ".join(trihedron.report(result).split())
    tilt = result.tilt
    # Two per cent of 90°; static noise predicts hundredths of a degree.
    assert tilt.actual == pytest.approx(0.02 * np.pi / 2, rel=0.2)
    assert tilt.predicted < 0.1 * tilt.actual
    log = turned_between_intervals(scale=1.0)
    found = trihedron.filter_noise(log, static=rest).intervals
    assert found.n == 4
    # Four stretches of 30 s: N / sqrt(15), a limit of K on top of it; twelve axes' changes scatter by a quarter.
    assert 0.4 * N / np.sqrt(15) < found.bias_change < 1.6 * N / np.sqrt(15)
    assert found.predicted > 0.9 * N / np.sqrt(15)
    assert found.gravity_spread < 1e-4
    drifting = replace(log, gyroscope=log.gyroscope + 1e-4 * log.time_s[:, None])
    worse = trihedron.filter_noise(drifting, static=rest).intervals
    assert worse.bias_change == pytest.approx(32 * 1e-4, rel=0.05)
    assert worse.predicted < 0.3 * worse.bias_change


def turned_between_intervals(scale):
    """Rests of 30 s with quarter turns about X between, a gyro whose scale is off."""
    rng = np.random.default_rng(7)
    rate = np.concatenate([x for _ in range(3) for x in (np.zeros(3000), np.full(200, np.pi / 4))] + [np.zeros(3000)])
    angle = np.cumsum(rate) / 100.0
    force = G * np.column_stack([0.0 * angle, np.sin(angle), np.cos(angle)])
    w = scale * np.column_stack([rate, 0.0 * rate, 0.0 * rate]) + 10 * N * rng.normal(size=force.shape)
    return Recording.from_arrays(np.arange(len(rate)) / 100.0, force + 0.01 * rng.normal(size=force.shape), w)


@pytest.mark.skipif(not EUROC.exists(), reason="the recorded flights are not beside this checkout")
def test_most_of_what_looks_like_noise_in_a_recorded_flight_is_its_truth():
    static = StaticNoise(Bounded(1.7e-4, 1.55e-4, 1.87e-4), Bounded(1.94e-5, 1.94e-5, 1.94e-5))
    log = trihedron.read(EUROC / "V1_02_medium.log.csv.gz")
    minute = log.time_s < 60.0
    log = replace(log, **{name: getattr(log, name)[minute] for name in ("time_s", "accelerometer", "gyroscope")})
    truth, asked = motion_of(EUROC / "V1_02_medium.truth.csv.gz"), beside.Request((10.0,), 50.0, 9.807, static)
    gyro, accelerometer = beside.beside_reference(log, truth, asked)[0]
    (one,) = gyro.consistency
    assert one.nees < 7.0
    assert one.static_nees > 30.0
    assert next(s.share.lower for s in gyro.shares if s.cause == "reference") > 0.6
    assert gyro.N.lower < 1.7e-4 * 1.3
    assert math.isfinite(accelerometer.N.value)


@pytest.mark.parametrize("far", [0.1, 10.0])
def test_the_greatest_posterior_is_found_from_strengths_that_are_far_off(far):
    # From a prior a factor of ten off on either side: searching along slopes alone ended on a ridge in a real flight.
    sigma = np.log([1.1, 2.0, 30.0, 30.0, 30.0, 4.0, 2.0, 2.0])
    there = np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0])
    near = Prior(np.log([N, 1.0, K, 3e-5, SLOW, TAU, 1.0, 1.0]), sigma, there)
    off = replace(near, mean=near.mean + np.log(far) * np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    x, _ = most_likely([drawn(3)], off)
    other, _ = most_likely([drawn(3)], near)
    # Under that prior nothing is likelier, the other prior's greatest posterior among it; 0.01 ends the search.
    assert height([drawn(3)], off, x) > height([drawn(3)], off, other) - 0.1
    slope, _ = _slope([drawn(3)], off, other)
    for k, e in enumerate(np.eye(len(other))):
        both = [height([drawn(3)], off, other + sign * 1e-3 * e) for sign in (1.0, -1.0)]
        assert slope[k] == pytest.approx((both[0] - both[1]) / 2e-3, abs=0.1)


def of_rest(n):
    return StaticNoise(Bounded(n, 0.97 * n, 1.03 * n), Bounded(0.0, 0.0, 1e-6, True))


@pytest.mark.parametrize(("times", "is_unlike"), [(1.0, False), (1.2, False), (8.0, True), (0.3, True)])
def test_a_static_log_whose_noise_is_not_that_of_the_logs_own_rest_is_noticed(times, is_unlike):
    found = list(unlike_this_log({"gyroscope": of_rest(times * N)}, {"gyroscope": of_rest(N)}, (), "static.csv"))
    assert [one.code for one in found] == ["filter-noise-other-static"] * is_unlike


def test_tilt_errors_far_above_their_prediction_make_static_values_untrustworthy():
    assert not list(too_sure(TiltCheck(20, 3.0, 2e-4, 1e-4)))
    (found,) = too_sure(TiltCheck(20, 3.0, 13e-4, 1e-4))
    assert found.severity is Severity.SERIOUS


def test_a_parameter_error_that_noise_explains_has_an_upper_limit_and_no_share():
    """Squares of estimates of nothing add up to more than nothing; an error of five sigma is seen."""
    rng, sigma, step = np.random.default_rng(6), 0.01, np.eye(9)[None]
    known = np.eye(9) / sigma**2
    limits = [
        bounded(mean_square(step, drawn_errors(known, (size + rng.normal(size=9)) / sigma, PARTS))).is_limit
        for size in [0.0] * 20 + [5.0] * 5
    ]
    assert sum(limits[:20]) >= 19
    assert not any(limits[20:])
