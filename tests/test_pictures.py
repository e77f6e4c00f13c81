"""What was looked at in the pictures and pages, and found wanting: held here, so that it stays mended."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.records import Finding, FindingCode, Recording, Severity, Verification
from trihedron.records.diagnosis import Candidate
from trihedron.records.domains import DomainTest
from trihedron.report.calibration_charts import residual_chart
from trihedron.report.chart import Bars, Note, Panel, Points, Scale
from trihedron.report.diagnosis_models import candidates_table
from trihedron.report.diagnosis_numbers import differing_noise
from trihedron.report.diagnosis_overview_charts import EXPLAINED, strengths_picture, traces_chart
from trihedron.report.drawn import _path
from trihedron.report.effect_charts import rest_panels
from trihedron.report.effects.catalogue import CATALOGUE as EFFECTS
from trihedron.report.findings.grouping import combined
from trihedron.report.findings.wording import filled
from trihedron.report.kalman_charts import innovations_chart
from trihedron.report.layout import Places, _box, _covered, apart, ticks
from trihedron.report.names import id_in_print, parameter_in_print, variable_in_print
from trihedron.report.numbers import unit_with_power, with_sigma_and_power
from trihedron.report.verification import verification_report


def places_of(x, y):
    return Places(Panel(Scale("x", limits=x), Scale("y", limits=y), ()))


def test_words_of_a_figure_stand_apart_and_inside_it():
    """A term whose name stands on the left of its mark, and the best averaging time above the curve beside it."""
    at = places_of((0.0, 1.0), (0.0, 1.0))
    notes = [
        Note(0.9, 0.5, "K < 0.000053", side="left"),
        Note(0.75, 0.45, "237 s"),
        Note(0.98, 0.9, "N 0.0040", side="right"),
    ]
    placed = apart(notes, at, 270.0)
    boxes = [_box(n.text, n.side, 250.0 * n.x, 270.0 * (1.0 - n.y)) for n in placed]
    for k, box in enumerate(boxes):
        assert _covered(box, boxes[:k]) == 0.0
        assert box[0] >= 0.0
        assert box[2] <= 250.0
    assert placed[0].side == "left"


@pytest.mark.parametrize("low", [0.0031, 0.31, 5.1])
@pytest.mark.parametrize("factor", [2.1, 3.0, 30.0])
def test_a_logarithmic_axis_has_two_figures_to_read_a_scale_from(low, factor):
    named = [word for _, word in ticks(low, factor * low, is_log=True) if word]
    assert 2 <= len(named) <= 8


def test_a_candidate_that_another_effect_made_needless_says_which():
    tried = (
        Candidate("sensor-lag", 2e-17, True, superseded_by="gyro-g-sensitivity"),
        Candidate("accel-cubic", 0.6, True),
    )
    table = candidates_table(SimpleNamespace(effects=(), candidates=tried))
    assert [row[-1] for row in table.rows] == ["redundant with gyro g-sensitivity", "not needed"]


def traces(scale, shift=0.0, models=None, units=("m/s^2", "rad/s")):
    """The chart of readings in SI and of the same in units of which one is ``scale`` and begins at ``shift``."""
    f, w = np.random.default_rng(3).normal(size=(2, 400, 3))
    time = np.arange(400) / 100.0
    si = Recording(time, f, w, 100.0, "m/s^2", "rad/s")
    ours = Recording(time, f / scale[0] - shift, w / scale[1] - shift, 100.0, *units)
    moves = [SimpleNamespace(start=100, stop=300)]
    segments = SimpleNamespace(accelerometer_sigma=np.ones(3), gyroscope_sigma=np.ones(3), moves=moves, poses=[])
    return traces_chart(ours, si, segments, *([models] if models else []))


def test_traces_in_two_units_are_drawn_in_the_recordings_or_corrected_where_counts_have_no_scale():
    def model(S, b):
        sensor = SimpleNamespace(S=S * np.eye(3), b=np.full(3, b), si_unit="m/s^2")
        return SimpleNamespace(accelerometer=sensor, gyroscope=sensor)

    in_g = traces((9.80665, np.pi / 180.0), units=("g", "deg/s"))
    assert [panel.y.label for panel in in_g.panels] == ["reading [g]", "reading [deg/s]"]
    counts = {"scale": (0.01, 0.01), "shift": 200.0, "units": ("counts", "counts")}
    assert traces(**counts) is None
    corrected = traces(**counts, models=(model(0.01, 2.0), model(1.0, 0.0)))
    assert all(panel.y.label.startswith("corrected [") for panel in corrected.panels)
    for panel in (*in_g.panels, *corrected.panels):
        mine, theirs = panel.marks
        assert theirs.y == pytest.approx(mine.y, rel=1e-9)


def test_small_numbers_have_one_notation_in_tables_and_sentences():
    assert with_sigma_and_power(8.804e-5, 1.3e-7) == "(8.804 ± 0.013)e−5"
    seen = filled("K is below {limit:.2g} {unit:unit}/√s.", {"limit": 7.3e-5, "unit": "m/s^2"}, {})
    assert seen == "K is below 7.3e−5 m/s²/√s."
    one = Finding(FindingCode.UNIT_DETECTED, Severity.NOTE, "K is below 7.3e−5 m/s².", "", "")
    (both,) = combined([one, replace(one, seen="K is below 1.2e−4 m/s².")])
    assert both.seen == "K is below 7.3e−5 to 1.2e−4 m/s²."


@pytest.mark.parametrize(
    ("exponent", "unit", "printed"),
    [(-6, "m", "µm"), (-3, "rad/s", "mrad/s"), (-6, "s²/m", "10⁻⁶ s²/m"), (0, "s", "s"), (-3, "", "10⁻³")],
)
def test_a_power_of_ten_is_a_prefix_where_the_unit_takes_one(exponent, unit, printed):
    assert unit_with_power(exponent, unit) == printed


def test_a_bias_of_a_static_log_is_drawn_over_temperature_with_its_curve_through_it():
    """Two orientations at temperatures of their own: the biases of each are drawn about its own mean."""
    heat = np.concatenate([np.linspace(10.0, 30.0, 300), np.linspace(30.0, 50.0, 300)])
    pose = np.repeat([0, 1], 300)
    apart = heat - heat.mean()
    bias = np.outer([1e-3, -2e-3, 0.0], apart) + np.outer([0.0, 0.0, 1e-4], apart**2)
    about = np.stack([bias[:, pose == p].mean(axis=1) for p in (0, 1)], axis=1)[:, pose]
    values = {"bias_per_kelvin_x": 1e-3, "bias_per_kelvin_y": -2e-3, "bias_per_kelvin2_z": 1e-4}
    parameters = [SimpleNamespace(name=name, value=value) for name, value in values.items()]
    series = {"time_s": [], "temperature_degc": heat.tolist(), "value": (bias - about).tolist(), "pose": pose.tolist()}
    model = {"variant": "static-curve", "curve": series | {"unit": "m/s^2"}}
    panels = rest_panels(SimpleNamespace(id="accel-thermal-bias", model=model, parameters=parameters))
    assert [panel.title for panel in panels] == [f"accelerometer {axis}" for axis in "XYZ"]
    for panel in panels:
        _, dots, curve = panel.marks
        assert len(dots.x) <= 200
        # Three neighbours are averaged: a parabola is above its chord by less than a thousandth of its height.
        np.testing.assert_allclose(dots.y, np.interp(dots.x, curve.x, curve.y), atol=2e-3 * np.ptp(curve.y))


@pytest.mark.parametrize(
    ("variable", "words"),
    [
        ("w_z", "angular rate Z"),
        ("|w|^2", "|angular rate|²"),
        ("w_x f_y", "angular rate X × specific force Y"),
        ("previous u_x", "previous specific force X"),
        ("last rotation about y", "last rotation about Y"),
        ("vector fixed in the world frame", "vector fixed in the world frame"),
    ],
)
def test_a_variable_of_a_relation_is_named_in_print(variable, words):
    assert variable_in_print(variable) == words


def test_innovations_are_drawn_as_large_as_they_are():
    nis = np.array([0.5, 60.0, 2.0])
    drawn = innovations_chart([SimpleNamespace(nis=nis, is_settled=np.ones(3, dtype=bool))])
    (dots,) = (mark for mark in drawn.panels[0].marks if isinstance(mark, Points))
    np.testing.assert_array_equal(dots.y, nis)


def test_what_differs_by_one_number_from_axis_to_axis_is_said_once():
    def told(axis, ratio):
        remark = f"The resolution (LSB) of the gyro is {ratio} times the recording's."
        return SimpleNamespace(sensor="gyroscope", axis=axis, term="resolution", significant=True, remark=remark)

    compared = [told("x", 0.123), told("y", 0.128), told("z", 0.124)]
    said = differing_noise(SimpleNamespace(noise_compared=compared))
    assert said == ["The resolution (LSB) of the gyro is 0.123 to 0.128 times the recording's."]


def test_the_bar_of_a_pose_that_determines_a_parameter_alone_does_not_hide_the_others():
    residual, sigma = 1e-3 * np.array([1.0, -2.0, 0.5, 1.5, -1.0]), np.full(5, 1e-3)
    lone = sigma.copy()
    lone[3] = 1.0
    quality = SimpleNamespace(residual=residual, sigma=sigma, held_out=2.0 * residual, held_out_sigma=lone)
    low, high = residual_chart(quality).panels[0].y.limits
    # All points, mm/s²; of the bar a thousand times as long no more than three usual ones.
    assert 4.0 < high == -low < 10.0


def test_a_path_of_relative_steps_goes_through_its_points_and_begins_anew_after_a_gap():
    x = np.array([0.0, 10.2, 24.8, 30.0, 7.0, 8.0, 40.0, 60.0])
    y = np.array([5.0, -3.0, 7.0, np.nan, 1.0, np.nan, 100.0, 90.0])
    assert _path(x, y) == "M0 5l10-8 15 10 M7 1M40 100l20-10"


def test_every_domain_is_a_bar_from_the_left_to_its_misfit_beside_the_limit_of_agreement():
    tests = (
        DomainTest("static-accel", 0.8, 20.0, 0.6, False, limit=2.0),
        DomainTest("static-gyro", 40.0, 20.0, 1e-9, True, limit=1.9),
        DomainTest("timing", 1.1, 20.0, 0.4, False),
    )
    found = SimpleNamespace(verdict="unexplained", domains=tests, remaining=(), effects=(), alpha=0.01)
    (panel,) = strengths_picture(found).chart().panels
    bars = {mark.name: mark for mark in panel.marks if isinstance(mark, Bars)}
    assert set(bars) == {"agrees up to here", "disagrees", "agrees"}
    np.testing.assert_array_equal(bars["agrees up to here"].x, [2.0, 1.9, np.nan])
    np.testing.assert_array_equal(bars["disagrees"].x, [np.nan, 40.0, np.nan])
    np.testing.assert_array_equal(bars["agrees"].x, [0.8, np.nan, 1.1])
    assert {float(value) for mark in bars.values() for value in mark.base} == {panel.x.limits[0]}
    # Disturbed poses explain their residual without reducing it.
    left = (tests[0], replace(tests[1], disagrees=False), tests[2])
    (panel,) = strengths_picture(SimpleNamespace(**vars(found) | {"remaining": left, "effects": (1,)})).chart().panels
    bars = {mark.name: mark for mark in panel.marks if isinstance(mark, Bars)}
    np.testing.assert_array_equal(bars[EXPLAINED].x, [np.nan, 40.0, np.nan])
    np.testing.assert_array_equal(bars["with the effects"].x, [0.8, np.nan, 1.1])


def test_the_error_that_fails_is_the_first_figure_of_a_verification():
    fine, high = np.full(12, 1e-3), np.full(11, 0.5)
    plain = Verification(
        "log", "", "", 9.8, "given", fine, fine, fine, 0.1 * high, 0.1 * high, 0.1 * high, np.zeros((12, 3)),
        np.arange(11), (),
    )  # fmt: skip
    tilted = Finding.of(FindingCode.HELD_OUT_WORSE, "verify-moves", severity=Severity.WARNING, angle_rms_deg=0.5,
                        worst_move=3, worst_deg=0.6, times=10.0,
                        chi2_per_dof=100.0, is_far=0.0, is_bias=0.0, is_single=0.0)  # fmt: skip
    limit = Finding.of(FindingCode.LIMIT_EXCEEDED, "moves", rms_deg=0.05, limit_deg=0.01)
    failing = (replace(plain, angle_deg=high, findings=(tilted,)), replace(plain, findings=(limit,)))
    gravity, tilt = (one.what for one in verification_report(plain).headlines)
    assert [[one.what for one in verification_report(v).headlines] for v in failing] == [[tilt, gravity]] * 2


def test_effects_and_parameters_are_named_in_words():
    hyphened = {"gyro g-sensitivity", "accelerometer-gyro time offset"}
    assert {name for name in map(id_in_print, EFFECTS) if "-" in name} == hyphened
    assert id_in_print("accel-misalignment-xy") == "accelerometer misalignment XY"
    names = ["K2_x", "sigma_x", "range_y", "limit_x+", "accelerometer_delay", "pose_at", "x"]
    said = ["K2_x", "σ_x", "range Y", "limit X+", "accelerometer delay", "pose at", "X"]
    assert [parameter_in_print(name) for name in names] == said
