"""The linear model's forms and frames with their uncertainty; attitude from a rate, of logs and of moves."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from trihedron import _core, units
from trihedron.gravity import normal_gravity
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import in_frame, other_form, other_form_jacobian, reframing

QUIET, NO_BIAS = _core.RateNoise(np.zeros(3), 0.0, np.inf), np.zeros((2, 3))
MOVED = np.array([[1.1, 0.02, -0.03], [0.01, 0.9, 0.04], [-0.05, 0.02, 1.05]])


def uneven(n: int, span: float, seed: int = 3) -> np.ndarray:
    """Instants whose steps differ by a factor of 2.3 at most: beyond 3 the cubic gives way to a straight line."""
    t = np.linspace(0.0, span, n)
    t[1:-1] += np.random.default_rng(seed).uniform(-0.2, 0.2, n - 2) * span / n
    return t


def coning(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """A body whose axis runs round a cone of half angle α at rate Ω: its rate in the body and its exact attitude."""
    alpha, big = 0.4, 9.0
    spin = 2.0 * np.pi * 0.7
    turn = Rotation.from_rotvec(np.outer(t, [0.0, 0.0, big]))
    tilt = Rotation.from_rotvec([alpha, 0.0, 0.0])
    own = Rotation.from_rotvec(np.outer(t, [0.0, 0.0, spin]))
    attitude = turn * tilt * own
    rate = attitude.inv().apply(np.tile([0.0, 0.0, big], (len(t), 1))) + np.array([0.0, 0.0, spin])
    return rate, tilt.inv() * attitude


def test_a_constant_rate_gives_the_closed_form_in_every_form_and_model():
    t = uneven(400, 7.0)
    w = np.array([0.7, -1.1, 0.4])
    truth = Rotation.from_rotvec(np.outer(t, w))
    for between in ("constant", "linear", "coning"):
        rate = np.tile(w, (400, 1))
        # 399 products, some ulp each.
        np.testing.assert_allclose(trihedron.integrate_rate(t, rate, between=between), truth.as_matrix(), atol=1e-13)
        quaternions = trihedron.integrate_rate(t, rate, between=between, form="quaternions")
        assert np.abs(np.diff(quaternions, axis=0)).max() < 0.1  # no jump of sign
        np.testing.assert_allclose(Rotation.from_quat(quaternions).as_matrix(), truth.as_matrix(), atol=1e-13)
        vectors = trihedron.integrate_rate(t, rate, between=between, form="vectors")
        np.testing.assert_allclose(vectors, truth.as_rotvec(), atol=1e-9)  # 1e-9 at half a turn, where the sign flips


@pytest.mark.parametrize(("between", "order"), [("constant", 1), ("linear", 2), ("coning", 4)])
def test_coning_is_integrated_with_the_order_of_the_model_on_uneven_steps(between, order):
    def error(n: int) -> float:
        t = uneven(n, 2.0)
        rate, truth = coning(t)
        found = Rotation.from_matrix(trihedron.integrate_rate(t, rate, between=between, last_only=True))
        return float((found * truth[-1].inv()).magnitude() + (truth[0].magnitude()))

    seen = np.log2(error(201) / error(1601)) / 3
    assert abs(seen - order) < 0.4  # uneven steps scatter the leading coefficient by a factor of two over three octaves


def test_the_straight_line_model_is_scipys_product_of_rotation_vectors():
    rng = np.random.default_rng(5)
    t = uneven(3000, 30.0)
    w = 2.0 * rng.standard_normal((3000, 3))
    h = np.diff(t)[:, None]
    steps = Rotation.from_rotvec((w[1:] + w[:-1]) * h / 2 + np.cross(w[:-1], w[1:]) * h**2 / 12).as_matrix()
    start = Rotation.from_euler("xyz", [0.3, -0.8, 2.0])
    truth = [start.as_matrix()]
    for step in steps:
        truth.append(truth[-1] @ step)
    for given in (start.as_matrix(), start.as_quat(), start.as_rotvec()):
        found = trihedron.integrate_rate(t, w, start=given)
        np.testing.assert_allclose(found, truth, atol=2e-13)  # 3000 products
        np.testing.assert_allclose(trihedron.integrate_rate(t, w, start=given, last_only=True), truth[-1], atol=2e-13)


def test_a_long_log_goes_on_from_any_of_its_samples():
    # Pieces of 32768 steps are worked on side by side: three of them, and a middle that lies at the end of none.
    rng = np.random.default_rng(6)
    t, w = np.cumsum(rng.uniform(0.005, 0.015, 80_000)), rng.standard_normal((80_000, 3))
    middle = 41_000
    at = trihedron.integrate_rate(t[: middle + 1], w[: middle + 1], last_only=True, between="constant")
    whole = trihedron.integrate_rate(t, w, last_only=True, between="constant")
    rest = trihedron.integrate_rate(t[middle:], w[middle:], start=at, last_only=True, between="constant")
    # 80000 products, some ulp each, of which errors go with the root.
    np.testing.assert_allclose(rest, whole, atol=1e-12)
    np.testing.assert_allclose(trihedron.integrate_rate(t, w, between="constant")[-1], whole, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t, w: (t, w[:-1]), "shape"),
        (lambda t, w: (t[:0], w[:0]), "at least 1"),
        (lambda t, w: (t, np.where(np.arange(50)[:, None] == 7, np.nan, w)), "rate of sample 7 is not finite"),
        (lambda t, w: (np.where(np.arange(50) == 9, np.inf, t), w), "time of sample 9 is not a number"),
        (lambda t, w: (np.where(np.arange(50) == 9, 0.0, t), w), "backward at sample 9"),
    ],
)
def test_bad_samples_are_refused_by_their_number(change, words):
    t, w = np.arange(50) / 10.0, np.ones((50, 3))
    with pytest.raises(ValueError, match=words):
        trihedron.integrate_rate(*change(t, w))


@pytest.mark.parametrize("start", [np.diag([1, 1, -1]), 1.01 * np.eye(3), [1.0, 1, 0, 0], [np.nan, 0, 0], [1.0, 0.0]])
def test_a_start_that_is_no_attitude_is_refused(start):
    with pytest.raises(ValueError, match="start"):
        trihedron.integrate_rate([0.0, 1.0], np.zeros((2, 3)), start=start)


def of_move(time_s, raw, degree, S=MOVED, b=NO_BIAS):
    """Rotation of one move, and what turns it by the scale (3, 9) and by the biases before and behind."""
    edges, anchors = np.array([[0, len(time_s)]]), np.array([[time_s[0] - 1.5, time_s[-1] + 2.5]])
    found = _core.integrate_moves(time_s, raw, edges, anchors, S[None], b[:1], b[1:], degree, QUIET)
    return [part[0] for part in found[:4]]


def wandering(t):
    """A rate whose direction wanders, so that the commutator matters."""
    return np.stack([np.sin(2.0 * t), 1.5 * np.cos(1.3 * t + 0.4), 0.7 * np.sin(2.9 * t)], axis=1)


@pytest.mark.parametrize(("degree", "order"), [(0, 1), (1, 2), (3, 4)])
def test_a_move_is_integrated_with_the_order_of_the_model_on_uneven_steps(degree, order):
    fine = np.linspace(0.0, 2.0, 40_001)
    truth = of_move(fine, wandering(fine), 3)[0]

    def error(n):
        t = uneven(n, 2.0)
        return Rotation.from_matrix(of_move(t, wandering(t), degree)[0] @ truth.T).magnitude()

    # Jitter scatters the leading coefficient by some ten per cent: a quarter of an order over four octaves.
    assert abs(np.log2(error(101) / error(1601)) / 4 - order) < 0.3


@pytest.mark.parametrize("degree", [0, 1, 3])
@pytest.mark.parametrize("size", [0.0, 1e-7, 1.0, 40.0])
def test_derivatives_of_a_move_match_differences_at_zero_tiny_ordinary_and_large_rates(degree, size):
    t, step = uneven(60, 2.5), 1e-5
    raw, b = size * wandering(t), size * np.array([[0.01, -0.02, 0.005], [-0.03, 0.01, 0.02]])
    R, *turned = of_move(t, raw, degree, MOVED, b)
    for k, e in enumerate(step * np.eye(15)):
        S, of_b = e[:9].reshape(3, 3), e[9:].reshape(2, 3)
        ahead, behind = (of_move(t, raw, degree, MOVED + sign * S, b + sign * of_b)[0] for sign in (1, -1))
        analytic = -R @ np.cross(np.eye(3), np.hstack(turned)[:, k])
        # Central differences: truncation ~ step² |∫w'|³ < 1e-9 at ordinary rates, rounding 1e-15/step = 1e-10.
        assert np.linalg.norm((ahead - behind) / (2 * step) - analytic) < 3e-9 * max(size, 1.0) ** 3, k


@pytest.mark.parametrize("size", [1e-7, 1.0, 60.0])
def test_a_move_is_its_two_parts_one_after_the_other(size):
    # A sample at which both parts meet, straight lines in them: B = B₂ B₁, G = G₁ + B₁ᵀ G₂, C = C₁ + B₁ᵀ C₂ B₁.
    t, b = uneven(61, 0.6), np.array([[0.01, -0.02, 0.005], [-0.03, 0.01, 0.02]])
    noise = _core.RateNoise(np.array([0.01, 0.02, 0.03]), 1e-4, 0.012)

    def of(start, stop):
        at = np.array([[start, stop]]), np.array([[-1.5, 3.1]])
        *found, _, covariance = _core.integrate_moves(t, size * wandering(t), *at, MOVED[None], b[:1], b[1:], 1, noise)
        return [part[0] for part in (*found, covariance)]

    (whole, *parts), (first, *begun), (second, *ended) = of(0, 61), of(0, 25), of(24, 61)
    np.testing.assert_allclose(whole, second @ first, atol=1e-12)
    ended[-1] = ended[-1] @ first
    for one, before, after in zip(parts, begun, ended, strict=True):
        # Some hundred products and sums of one order, each good to some ulp.
        np.testing.assert_allclose(one, before + first.T @ after, rtol=0.0, atol=1e-12 * np.linalg.norm(one))


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-3, 0.4, 0.6, 3.0, np.pi - 1e-3, np.pi - 1e-6])
def test_rotations_are_those_of_scipy_and_give_their_vectors_back(angle):
    axes = np.random.default_rng(9).normal(size=(100, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=1)[:, None]
    found = _core.rotation_from_vector(vectors)
    # Products of numbers near one: a few ulp.
    np.testing.assert_allclose(found, Rotation.from_rotvec(vectors).as_matrix(), rtol=0.0, atol=2e-15)
    # Half the digits would be lost near a half turn if the axis came from the antisymmetric part.
    np.testing.assert_allclose(_core.vector_from_rotation(found), vectors, rtol=0.0, atol=1e-12)


def test_a_move_bridges_lost_rows_and_repeated_timestamps_and_is_refused_outside_the_log():
    t, w = np.linspace(0.0, 2.0, 101), np.array([0.4, 0.1, -0.2])
    raw = np.tile(w, (101, 1))
    raw[40], t[60] = np.nan, t[59]
    for degree in (0, 1, 3):
        found = of_move(t, raw, degree, np.eye(3))[0]
        np.testing.assert_allclose(found, Rotation.from_rotvec(-2.0 * w).as_matrix(), rtol=0, atol=3e-14)
    back = np.where(np.arange(101) == 4, 0.0, t)
    for time_s, stop, end in ((t, 102, 4.5), (back, 101, 4.5), (t, 101, -1.5)):
        edges, anchors = np.array([[0, stop]]), np.array([[-1.5, end]])
        with pytest.raises(ValueError, match=r"\w"):
            _core.integrate_moves(time_s, raw, edges, anchors, MOVED[None], NO_BIAS[:1], NO_BIAS[1:], 1, QUIET)


def triad(seed: int, *, left_handed: bool = False) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    S = np.diag(1 + 0.1 * rng.uniform(-1, 1, 3)) + 0.05 * rng.uniform(-1, 1, (3, 3))
    if left_handed:
        S = S * [1, -1, 1]
    return S, rng.uniform(-1, 1, 3)


def parameters(S, b):
    return np.concatenate([np.ravel(S), b])


def numeric_jacobian(function, x, step=1e-6):
    """Central differences: rounding 1e-16/1e-6."""
    return np.column_stack([(function(x + e) - function(x - e)) / (2 * step) for e in step * np.eye(len(x))])


def test_the_two_forms_are_inverse_to_each_other_with_the_stated_derivative_and_none_has_parallel_axes():
    S, b = triad(2)
    S_a, b_a = other_form(S, b)
    f = np.array([[1.0, -2.0, 9.0]])
    np.testing.assert_allclose(f @ S_a.T + b_a, np.linalg.solve(S, (f - b).T).T, atol=1e-13)
    back = other_form(S_a, b_a)
    np.testing.assert_allclose(back[0], S, atol=1e-14)
    np.testing.assert_allclose(back[1], b, atol=1e-14)
    numeric = numeric_jacobian(lambda x: parameters(*other_form(x[:9].reshape(3, 3), x[9:])), parameters(S, b))
    np.testing.assert_allclose(other_form_jacobian(S, b), numeric, atol=1e-8)
    with pytest.raises(ValueError, match="parallel"):
        other_form(np.ones((3, 3)), np.zeros(3))


@pytest.mark.parametrize("left_handed", [False, True])
@pytest.mark.parametrize("frame", ["lower", "symmetric"])
def test_a_frame_is_reached_by_a_proper_rotation_of_the_stated_derivative(frame, left_handed):
    for seed in range(5):
        S, b = triad(seed, left_handed=left_handed)
        change = reframing(S, b, frame)
        R = change.rotation
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1.0)
        new = R @ S
        if frame == "lower":
            assert np.abs(np.triu(new, 1)).max() < 1e-14
        else:
            signs = np.sign(np.diag(new))
            np.testing.assert_allclose(new * signs, (new * signs).T, atol=1e-14)
        # The sign of the determinant, handedness, is kept and not turned into a half turn.
        assert np.sign(np.linalg.det(new)) == np.sign(np.linalg.det(S))
        assert np.trace(R) > 2.9

        def moved(x, frame=frame):
            S, b = x[:9].reshape(3, 3), x[9:]
            R = reframing(S, b, frame).rotation
            return parameters(R @ S, R @ b)

        np.testing.assert_allclose(change.jacobian, numeric_jacobian(moved, parameters(S, b)), atol=1e-8)


@pytest.mark.parametrize("frame", ["lower", "symmetric"])
def test_the_gyro_turns_with_the_accelerometer_and_shares_its_uncertainty(frame):
    root = 1e-3 * np.random.default_rng(7).standard_normal((24, 24))
    covariance = root @ root.T
    accelerometer = SensorCalibration(*triad(7), covariance[:12, :12], "m/s^2", "m/s^2", "test")
    gyroscope = SensorCalibration(*triad(107), covariance[12:, 12:], "rad/s", "rad/s", "test")
    calibration = Calibration(accelerometer, gyroscope, covariance, "case", 9.81, "test")
    new = in_frame(calibration, frame)
    R = new.accelerometer.S @ np.linalg.inv(calibration.accelerometer.S)
    np.testing.assert_allclose(new.gyroscope.S, R @ calibration.gyroscope.S, atol=1e-14)

    def moved(x):
        a, w = x[:12], x[12:]
        R = reframing(a[:9].reshape(3, 3), a[9:], frame).rotation
        return np.concatenate([(R @ s[:9].reshape(3, 3)).ravel() for s in (a, w)] + [R @ a[9:], R @ w[9:]])

    x = np.concatenate([parameters(s.S, s.b) for s in (calibration.accelerometer, calibration.gyroscope)])
    order = [*range(9), *range(18, 21), *range(9, 18), *range(21, 24)]
    jacobian = numeric_jacobian(moved, x)[order]
    expected = jacobian @ calibration.covariance @ jacobian.T
    # Entries of 1e-5; differences are good to eight digits.
    np.testing.assert_allclose(new.covariance, expected, atol=1e-11)
    np.testing.assert_array_equal(new.covariance[12:, 12:], new.gyroscope.covariance)


def test_normal_gravity_has_its_published_values_and_impossible_places_are_refused():
    # Equator and pole by definition of WGS 84; 45° from NIMA TR8350.2.
    assert normal_gravity(0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert normal_gravity(90.0) == pytest.approx(9.8321849378, abs=1e-9)
    assert normal_gravity(45.0) == pytest.approx(9.806197769, abs=1e-8)
    assert normal_gravity(-45.0) == normal_gravity(45.0)
    # Free-air gradient, 3.086e-6 s⁻² at mid latitudes, to its third digit.
    assert (normal_gravity(45.0) - normal_gravity(45.0, 1000.0)) / 1000.0 == pytest.approx(3.086e-6, abs=3e-9)
    for latitude, height in ((91.0, 0.0), (float("nan"), 0.0), (0.0, 1e6)):
        with pytest.raises(ValueError, match="must be between"):
            normal_gravity(latitude, height)


def test_units_have_the_sizes_of_the_international_system():
    rate, of = units.rate_to_si, units.RateUnit
    # The unit g is defined as 9.80665 m/s²; a degree is pi/180.
    assert units.acceleration_to_si(units.AccelerationUnit.G) == 9.80665
    assert units.acceleration_to_si(units.AccelerationUnit.MG) == pytest.approx(9.80665e-3, rel=1e-15)
    assert rate(of.DEG_S) == pytest.approx(0.017453292519943295, rel=1e-15)
    assert (rate(of.MDEG_S), rate(of.MRAD_S)) == pytest.approx((1.7453292519943e-5, 1e-3))
    assert (rate(of.DEG_H), rate(of.RPM)) == pytest.approx((4.848136811095e-6, 0.10471975512))
    assert units.acceleration_lsb_to_si("0.061 mg") == pytest.approx(0.061e-3 * 9.80665)
    assert units.rate_lsb_to_si("0.05 deg/s") == pytest.approx(8.726646259971648e-4)
    assert units.mg_from_m_s2(9.80665) == pytest.approx(1000.0)
    assert units.m_s2_from_micro_g(1e6) == pytest.approx(9.80665)
    assert (units.degrees_from_radians(np.pi), units.radians_from_degrees(180.0)) == pytest.approx((180.0, np.pi))
