"""Attitude from a rate: closed forms, SciPy's rotations, orders of convergence, bad input in words."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron


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


def test_samples_that_share_a_timestamp_do_not_turn_between_them():
    t, w = uneven(600, 6.0), np.tile([0.3, -0.2, 0.5], (600, 1))
    t[300] = t[299]
    for between in ("constant", "linear", "coning"):
        found = trihedron.integrate_rate(t, w, between=between)
        np.testing.assert_allclose(found[300], found[299], atol=1e-15)


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


@pytest.mark.parametrize(
    ("option", "words"),
    [
        *(({"start": s}, "start") for s in (np.diag([1, 1, -1]), 1.01 * np.eye(3), [1.0, 1, 0, 0], [np.nan, 0, 0])),
        ({"start": [1.0, 0.0]}, "start"),
    ],
)
def test_a_start_that_is_no_attitude_is_refused(option, words):
    with pytest.raises(ValueError, match=words):
        trihedron.integrate_rate([0.0, 1.0], np.zeros((2, 3)), **option)
