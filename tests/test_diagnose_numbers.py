"""The numbers beside effects: shapes are unknowns too, a scatter gives way to what explains it."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.selection.compare import refit
from trihedron.diagnose.selection.model import Accepted, begin, held_out, with_only
from trihedron.diagnose.selection.score import Scored, score_all
from trihedron.diagnose.selection.shapes import with_shapes
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.solve import extend, fit, tune_noise
from trihedron.diagnose.session.starting_point import start_twin
from trihedron.diagnose.session.twin import STATIC_GYRO, stacked
from trihedron.segment import resegment, segment_recording
from trihedron.simulate import hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.named import _of
from trihedron.simulate.profiles import profile_by_name


def begun(effects, seed, n_poses=24):
    """A session with flaws and the model of it that knows none."""
    scenario = _of(profile_by_name("mpu"), hand_session(n_poses, layout=seed), "session", seed)
    for effect_id, size in effects.items():
        scenario = with_effect(scenario, effect_id, **size)
    recording, truth = simulate(scenario, seed)
    obs = observe(recording, resegment(recording, segment_recording(recording)))
    calibration = trihedron.calibrate(recording, gravity_m_s2=truth.gravity_m_s2).calibration
    return begin(obs, start_twin(obs, calibration), None)


CREEP = {"accel-hysteresis": {"offset_m_s2": 0.0, "width_m_s2": 0.0, "creep_fraction": 0.004, "creep_tau_s": 8.0}}


def with_creep(model, tau_s):
    """The model with a creep of a time constant as a profile would leave it."""
    effect = next(one for one in catalogue() if one.id == "accel-hysteresis")
    variant = next(v for v in effect.variants(model.context) if v.label == "creep")
    made = effect.reshaped(model.context, variant, tau_s)
    made = replace(made, shape={"time_constant": (tau_s, "s")}, shape_sigma=0.1 * tau_s)
    return with_only(model, (Accepted(effect, made, None, 1e-9, 50.0, 50.0, ()),))


@pytest.mark.parametrize("seed", [3, 4])
def test_a_shape_is_fitted_with_everything_else_and_widens_every_error_bar(seed):
    model = with_creep(begun(CREEP, seed), 1.3 * 8.0)
    moved, numbers = with_shapes(model, model.fitted)
    variant = moved.accepted[0].variant
    tau = variant.shape["time_constant"][0]
    # Five standard errors: the simulator's creep works inside the converter, the catalogue's on the corrected reading.
    assert abs(tau - 8.0) < 5.0 * variant.shape_sigma
    assert variant.shape_sigma < 1.0
    n = numbers.n_effect - 1
    start = replace(numbers.twin, effect=numbers.twin.effect[:n])
    again, _ = with_shapes(moved, fit(moved.obs, start, stacked(moved.distortions)))
    assert again.accepted[0].variant.shape["time_constant"][0] == pytest.approx(tau, abs=0.3 * variant.shape_sigma)
    fixed = np.sqrt(np.diag(fit(moved.obs, start, stacked(moved.distortions)).covariance()))
    free = np.sqrt(np.diag(numbers.covariance()))[: len(fixed)]
    assert (free > 0.999 * fixed).all()
    assert (free > 1.05 * fixed).any()


def test_a_shape_that_the_session_does_not_tell_stays_as_it_was_chosen():
    model = with_creep(begun({}, 5), 8.0)  # nothing creeps here
    kept, numbers = with_shapes(model, model.fitted)
    assert kept.accepted[0].variant.shape == model.accepted[0].variant.shape
    assert numbers.n_effect == model.fitted.n_effect


def test_a_scatter_that_was_named_before_an_effect_is_less_beside_it():
    sizes = {"accel-cubic": {"k3": (8e-5, -8e-5, 8e-5)}, "accel-zero-scatter": {"sigma": 0.004}}
    model = begun(sizes, 6, 40)
    si = model.context.si_per_raw("accelerometer")
    named = np.zeros((2, 3))
    named[0] = 0.012 / si  # three times what it is: the cubic's misfit was counted in
    obs = replace(model.obs, zero_scatter=named)
    base = tune_noise(obs, model.fitted.twin, stacked([]), None)
    cubic = next(s for s in score_all(model.context, ())[0] if s.effect.id == "accel-cubic")
    beside = extend(base, stacked([]), cubic.variant.distortion)
    # Of 40 lengths less twelve numbers a scatter is known to 13 %, three of which are 40 %.
    assert 0.2 < beside.twin.scatter[0] < 0.47
    assert beside.twin.scatter[0] < 0.7 * base.twin.scatter[0]
    assert beside.twin.scatter[1] == pytest.approx(1e-3)  # the gyro's was not named


def test_a_late_clock_and_the_other_sensors_filter_are_equals_whatever_poses_lengths_weigh():
    model = begun({"accel-gyro-time-offset": {"offset_s": -0.006}}, 7)
    scored = score_all(model.context, ())[0]
    best: dict[str, Scored] = {}
    for one in scored:
        best.setdefault(one.effect.id, one)
    late, lag = (refit(model, best[i]).against for i in ("accel-gyro-time-offset", "sensor-lag"))
    rest = np.minimum(late.stays, lag.stays)
    assert late.equals(lag, rest, 6.0) == (late.likelihood_gain - late.cost > lag.likelihood_gain - lag.cost - 6.0)
    assert late.equals(late, rest, 6.0)
    other = refit(model, best["accel-hidden-drift"]).against
    assert not other.equals(late, rest, 6.0)


def test_a_model_that_needs_a_scatter_of_hundreds_of_errors_pays_for_it_held_out():
    model = begun({}, 8)
    noise = model.obs.hold_rate_sigma.mean(axis=0)
    costs = []
    for times in (30.0, 300.0):
        named = np.zeros((2, 3))
        named[1] = times * noise
        base = fit(replace(model.obs, zero_scatter=named), model.fitted.twin, stacked([]))
        seen = held_out(base)
        # All three axes of all poses are predicted, however badly: left out, a huge scatter cost nothing.
        assert seen.n_rows[STATIC_GYRO] == pytest.approx(3 * model.obs.n_holds, rel=0.01)
        costs.append(seen.fold_log_det.sum())
    # Per axis and pose ln 10² more, with nothing to show for it.
    assert costs[1] - costs[0] > 0.8 * 3 * model.obs.n_holds * 2.0 * np.log(10.0)
