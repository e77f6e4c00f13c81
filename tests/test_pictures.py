"""What was looked at in the pictures and pages, and found wanting: held here, so that it stays mended."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.records import Finding, FindingCode, Severity
from trihedron.records.domains import DomainTest
from trihedron.report.chart import Bars
from trihedron.report.diagnosis_overview_charts import EXPLAINED, strengths_picture
from trihedron.report.drawn import _path
from trihedron.report.findings.grouping import combined
from trihedron.report.findings.wording import filled
from trihedron.report.layout import ticks
from trihedron.report.numbers import unit_with_power, with_sigma_and_power


@pytest.mark.parametrize("low", [0.0031, 0.31, 5.1])
@pytest.mark.parametrize("factor", [2.1, 3.0, 30.0])
def test_a_logarithmic_axis_has_two_figures_to_read_a_scale_from(low, factor):
    named = [word for _, word in ticks(low, factor * low, is_log=True) if word]
    assert 2 <= len(named) <= 8


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
