"""What was looked at in the pictures and pages, and found wanting: held here, so that it stays mended."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import trihedron
from diagnosed_session import simulated
from trihedron.cli import main
from trihedron.records import Finding, FindingCode, Severity
from trihedron.records.diagnosis import Candidate
from trihedron.report.calibration_charts import MARK, residual_chart, sphere_chart
from trihedron.report.chart import Note, Panel, Scale
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.diagnosis_models import candidates_table
from trihedron.report.diagnosis_numbers import differing_noise
from trihedron.report.diagnosis_overview_charts import traces_chart
from trihedron.report.directions import drawn_disc
from trihedron.report.document import Picture, Table
from trihedron.report.effect_charts import rest_panels
from trihedron.report.findings.grouping import combined
from trihedron.report.findings.wording import filled
from trihedron.report.layout import Places, _box, _covered, apart, ticks
from trihedron.report.numbers import unit_with_power, with_sigma_and_power
from trihedron.report.segments import signals_picture
from trihedron.report.sessions import DRIFTING, sessions_chart, sessions_report
from trihedron.simulate import hand_session, scenario_by_name, simulate
from trihedron.units import AccelerationUnit, RateUnit


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


def test_letters_of_a_disc_stand_clear_of_poses_on_its_rim():
    rim = [
        (1.0, 0.0, "1", "", "taken"),
        (-1.0, 0.0, "2", "", "taken"),
        (0.0, 1.0, "3", "", "taken"),
        (0.0, -1.0, "4", "", "taken"),
    ]
    drawn = drawn_disc(SimpleNamespace(title="", points=tuple(rim)), "")
    words = re.findall(r'<text x="(-?\d+)" y="(-?\d+)">([+−][XY])</text>', drawn)
    assert len(words) == 4
    for x, y, _ in words:
        # Letters of nine pixels: half as wide as they are many, six above the line that they stand on.
        across = abs(int(x)) - 5.5 if int(x) else np.inf
        along = int(y) if int(y) > 50 else -int(y)
        along = (along - 7.0 if int(y) > 0 else along) if not int(x) else np.inf
        assert min(across, along) >= 107.5 + 1.0


@pytest.mark.parametrize("low", [0.0031, 0.0042, 0.31, 2.9, 5.1])
@pytest.mark.parametrize("factor", [2.1, 3.0, 6.0, 30.0])
def test_a_logarithmic_axis_has_two_figures_to_read_a_scale_from(low, factor):
    named = [word for _, word in ticks(low, factor * low, is_log=True) if word]
    assert 2 <= len(named) <= 8


def test_a_caption_speaks_of_disturbed_poses_where_there_are_some():
    recording, _ = simulate(replace(scenario_by_name("hand-session"), motion=hand_session(n_poses=4)), 1)
    found = trihedron.segment(recording)
    assert "orange" not in signals_picture(recording, found).caption
    knocked = replace(
        found,
        poses=(
            replace(found.poses[0], disturbed=((found.poses[0].start, found.poses[0].start + 5),)),
            *found.poses[1:],
        ),
    )
    assert "orange where a pose was disturbed" in signals_picture(recording, knocked).caption


@pytest.fixture(scope="module")
def model():
    motion = hand_session(n_poses=18, pose_s=2.0, move_s=1.5)
    logs = [simulate(replace(scenario_by_name("hand-session"), motion=motion), seed)[0] for seed in (1, 2)]
    return trihedron.calibrate_sessions(logs, gravity_m_s2=9.80665).model


def test_no_parameter_of_many_recordings_is_drawn_twice_and_each_is_named(model):
    document = sessions_report(model)
    pictures = [b for s in document.sections for b in s.blocks if isinstance(b, Picture)]
    first, second = ({panel.y.label for panel in one.chart().panels} for one in (document.lead, *pictures))
    assert not first & second
    for panel in sessions_chart(model).panels:
        names = {mark.name for mark in panel.marks if getattr(mark, "said", None)}
        assert names == ({"XY", "XZ", "YZ"} if "misalignment" in panel.y.label else {"X", "Y", "Z"}), panel.y.label
    assert {label.split()[0] for label in first} == set(DRIFTING)


def test_without_an_effect_the_model_is_not_written_down_twice():
    found = trihedron.diagnose(simulated("", 5, 18)[0], gravity_m_s2=9.81)
    assert not found.effects
    sections = {section.heading: section for section in diagnosis_report(found).sections}
    tables = [block for block in sections["Calibration and noise"].blocks if isinstance(block, Table)]
    assert [table.head for table in tables] == [("", "linear model")] * 2
    assert all(row[-1] for row in candidates_table(found).rows)


def test_a_candidate_that_another_effect_made_needless_says_which():
    tried = (
        Candidate("sensor-lag", 2e-17, True, superseded_by="gyro-g-sensitivity"),
        Candidate("accel-cubic", 0.6, True),
    )
    table = candidates_table(SimpleNamespace(effects=(), candidates=tried))
    assert [row[-1] for row in table.rows] == ["redundant with gyro-g-sensitivity", "not needed"]


def counts_model(S, b):
    """Both sensors by the same S (diagonal) and b."""
    sensor = SimpleNamespace(S=S * np.eye(3), b=np.full(3, b), si_unit="m/s^2")
    return SimpleNamespace(accelerometer=sensor, gyroscope=sensor)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ((AccelerationUnit.G, RateUnit.DEG_S), (1.0 / 9.80665, 180.0 / np.pi)),
        ((AccelerationUnit.COUNTS, RateUnit.COUNTS), (1.0, 1.0)),
    ],
)
def test_traces_in_two_physical_units_are_drawn_in_that_of_the_recording(unit, factor):
    """A simulation in SI over a log in g and °/s; counts have no scale to be drawn in but that of their model."""
    rng = np.random.default_rng(3)
    time = np.arange(400) / 100.0
    f, w = rng.normal(size=(2, 400, 3))
    si = {
        "time_s": time,
        "accelerometer": f,
        "gyroscope": w,
        "accelerometer_unit": AccelerationUnit.M_S2,
        "gyroscope_unit": RateUnit.RAD_S,
    }
    ours = {
        **si,
        "accelerometer": factor[0] * f,
        "gyroscope": factor[1] * w,
        "accelerometer_unit": unit[0],
        "gyroscope_unit": unit[1],
    }
    segments = SimpleNamespace(
        accelerometer_sigma=np.ones(3),
        gyroscope_sigma=np.ones(3),
        moves=[SimpleNamespace(start=100, stop=300)],
        poses=[],
    )
    chart = traces_chart(SimpleNamespace(**ours, n_samples=400), SimpleNamespace(**si), segments)
    if unit[0] is AccelerationUnit.COUNTS:
        assert chart is None
        models = (counts_model(0.01, 2.0), counts_model(1.0, 0.0))
        ours = SimpleNamespace(**ours | {"accelerometer": 100.0 * (f - 2.0), "gyroscope": 100.0 * (w - 2.0)})
        ours.n_samples = 400
        chart = traces_chart(ours, SimpleNamespace(**si), segments, models)
        for panel in chart.panels:
            assert panel.y.label.startswith("corrected [")
            assert panel.marks[1].y == pytest.approx(panel.marks[0].y, rel=1e-9)
        return
    assert [panel.y.label for panel in chart.panels] == ["reading [g]", "reading [deg/s]"]
    for panel in chart.panels:
        mine, theirs = panel.marks
        assert theirs.y == pytest.approx(mine.y, rel=1e-9)


def test_small_numbers_have_one_notation_in_tables_and_sentences():
    assert with_sigma_and_power(8.804e-5, 1.3e-7) == "(8.804 ± 0.013)e−5"
    seen = filled("K is below {limit:.2g} {unit:unit}/√s.", {"limit": 7.3e-5, "unit": "m/s^2"}, {})
    assert seen == "K is below 7.3e−5 m/s²/√s."
    one = Finding(FindingCode.UNIT_DETECTED, Severity.NOTE, "K is below 7.3e−5 m/s².", "", "")
    (both,) = combined([one, replace(one, seen="K is below 1.2e−4 m/s².")])
    assert both.seen == "K is below 7.3e−5 to 1.2e−4 m/s²."


def test_a_plan_keeps_what_one_came_for_in_its_tables_at_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["plan"]) == 0
    assert "continued" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("exponent", "unit", "printed"),
    [
        (-3, "s", "ms"),
        (-6, "m", "µm"),
        (-3, "rad/s", "mrad/s"),
        (-6, "s²/m", "10⁻⁶ s²/m"),
        (0, "s", "s"),
        (-3, "", "10⁻³"),
    ],
)
def test_a_power_of_ten_is_a_prefix_where_the_unit_takes_one(exponent, unit, printed):
    assert unit_with_power(exponent, unit) == printed


def test_a_bias_of_a_static_log_is_drawn_over_temperature_with_its_curve_through_it():
    """Two orientations at temperatures of their own: the biases of each are told about its own mean."""
    heat = np.concatenate([np.linspace(10.0, 30.0, 300), np.linspace(30.0, 50.0, 300)])
    pose = np.repeat([0, 1], 300)
    apart = heat - heat.mean()
    bias = np.outer([1e-3, -2e-3, 0.0], apart) + np.outer([0.0, 0.0, 1e-4], apart**2)
    about = np.stack([bias[:, pose == p].mean(axis=1) for p in (0, 1)], axis=1)[:, pose]
    values = {"bias_per_kelvin_x": 1e-3, "bias_per_kelvin_y": -2e-3, "bias_per_kelvin2_z": 1e-4}
    parameters = [SimpleNamespace(name=name, value=value) for name, value in values.items()]
    series = {"time_s": [], "temperature_degc": heat.tolist(), "value": (bias - about).tolist(), "pose": pose.tolist()}
    model = {"variant": "rest-curve", "curve": series | {"unit": "m/s^2"}}
    panels = rest_panels(SimpleNamespace(model=model, parameters=parameters))
    assert [panel.title for panel in panels] == ["X", "Y", "Z"]
    for panel in panels:
        _, dots, curve = panel.marks
        assert len(dots.x) <= 200
        # Three neighbours are averaged: a parabola is above its chord by less than a thousandth of its height.
        np.testing.assert_allclose(dots.y, np.interp(dots.x, curve.x, curve.y), atol=2e-3 * np.ptp(curve.y))


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


def test_numbers_of_poses_alike_do_not_cover_one_another():
    result = trihedron.calibrate(trihedron.simulate("hand-session", 3)[0], gravity_m_s2=9.81)
    means = np.repeat(result.segments.accelerometer_mean, 2, axis=0)
    for disc in sphere_chart(result.accelerometer, means).panels:
        named = np.array([[x, y] for x, y, label, *_ in disc.points if label])
        apart = np.linalg.norm(named[:, None] - named, axis=2) + 10.0 * np.eye(len(named))
        assert len(named) >= 8
        assert apart.min() >= MARK
