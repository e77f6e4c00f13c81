"""Every kind of report in a real browser: no error, no request, nothing beyond the edge of a phone, no barrier."""

import json
import re
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from this_run import once
from trihedron.cli import main
from trihedron.files.log import write_recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine"),
    pytest.mark.skipif(find_spec("playwright") is None, reason="playwright is not installed (extra test)"),
    pytest.mark.skipif(find_spec("axe_playwright_python") is None, reason="axe-playwright-python is not installed"),
    pytest.mark.filterwarnings("default"),
]
KINDS = ("calibrate", "verify", "segment", "check", "allan", "kalman", "diagnose", "simulate", "plan")
WIDTH = "document.documentElement.scrollWidth"
# Pages share one sheet of styles: these hold all parts that it gives a colour to, and a verdict with its figure.
WITH_A_FIGURE = ("calibrate", "allan", "diagnose")
# What these are laid out of stands in the others as well.
ALIKE = {"segment", "check", "kalman"}


@pytest.fixture(scope="module")
def folder():
    return once("reports", write_reports)


def write_reports(made):
    """One report of every kind, on simulated logs."""
    first, second, rest, cal = (str(made / name) for name in ("log.csv", "other.csv", "static.npz", "cal.json"))
    for path, n, seed in ((first, 16, 3), (second, 12, 9)):
        motion = hand_session(n_poses=n, pose_s=3.0, move_s=1.5, first_pose_s=5.0)
        write_recording(simulate(replace(scenario_by_name("hand-session"), motion=motion), seed)[0], Path(path))
    gyr, acc = np.random.default_rng(4).normal(size=(2, 60_000, 3))
    np.savez(rest, t=np.arange(60_000) / 100.0, gyr=1e-3 * gyr, acc=[0.0, 0.0, 9.8] + 1e-2 * acc)
    gravity = ["--gravity", "9.80665"]
    lines = {
        "calibrate": [first, *gravity, "-o", cal],
        "verify": [cal, second, *gravity],
        "segment": [first],
        "check": [first],
        "allan": [rest, "--gyro-unit", "rad/s"],
        "kalman": [first, *gravity],
        "diagnose": [first, *gravity],
        "simulate": ["hand-session", "-o", str(made / "made.csv")],
        "plan": [],
    }
    for kind in KINDS:
        assert main([kind, *lines[kind], "--report", str(made / f"{kind}.html")]) in (0, 2), kind


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        opened = tool.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def axe():
    import axe_playwright_python

    return (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")


class Visit:
    """A page opened, with everything that it said and requested."""

    def __init__(self, browser, path, width, scheme):
        self.said, self.asked = [], []
        self.page = browser.new_page(viewport={"width": width, "height": 844}, color_scheme=scheme)
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(path.as_uri())


def barriers_of(page, axe):
    """What a reader without eyes or hands would stumble over, everything unfolded."""
    for closed in page.query_selector_all("summary"):
        closed.click()
    page.evaluate(axe)
    found = json.loads(page.evaluate("axe.run().then((r) => JSON.stringify(r.violations))"))
    return [(v["id"], v["nodes"][0]["html"][:160]) for v in found]


@pytest.mark.parametrize("kind", [pytest.param(k, marks=pytest.mark.slow if k in ALIKE else ()) for k in KINDS])
def test_a_report_fits_a_phone_and_the_paper_and_has_no_barrier(folder, browser, axe, kind):
    visit = Visit(browser, folder / f"{kind}.html", 695, "light")
    page = visit.page
    # A4 less margins of 13 mm: 184 mm at 96 to the inch.
    page.emulate_media(media="print")
    assert page.evaluate(WIDTH) <= 695
    page.emulate_media(media="screen")
    page.set_viewport_size({"width": 390, "height": 844})
    # Tools of a figure hide no mark.
    for panel in page.query_selector_all("header .panel"):
        tools, plot = panel.query_selector(".tools").bounding_box(), panel.query_selector(".plot").bounding_box()
        assert tools["y"] + tools["height"] <= plot["y"] + 1.0
    assert barriers_of(page, axe) == []
    assert page.evaluate(WIDTH) <= 390
    # A table without a caption is announced as a mere table.
    assert 'aria-label="table"' not in (folder / f"{kind}.html").read_text(encoding="utf-8")
    assert visit.said == []
    assert visit.asked == [(folder / f"{kind}.html").as_uri()]
    page.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_report_has_result_and_remedy_on_its_first_screen_and_is_read_in_the_dark(folder, browser, axe, kind):
    page = Visit(browser, folder / f"{kind}.html", 1280, "dark").page
    told = [box for part in (".foremost", ".next") if (box := page.query_selector(part)) is not None]
    assert told or kind == "simulate"
    assert all(0 < box.bounding_box()["y"] < 400 for box in told)
    assert any("→" in box.inner_text() for box in told) or kind == "simulate"
    if kind in WITH_A_FIGURE:
        for part in (".verdict", "header .plot"):
            box = page.query_selector(part).bounding_box()
            assert 0 < box["y"] < 800
            assert box["height"] > 10
        assert barriers_of(page, axe) == []
    assert page.evaluate(WIDTH) <= 1280
    page.close()


def test_a_hundred_poses_fit_two_hundred_kilobytes(tmp_path):
    motion = hand_session(n_poses=100, pose_s=2.0, move_s=1.5, first_pose_s=5.0)
    write_recording(simulate(replace(scenario_by_name("hand-session"), motion=motion), 5)[0], tmp_path / "log.csv")
    page = tmp_path / "page.html"
    assert main(["calibrate", str(tmp_path / "log.csv"), "--gravity", "9.80665", "--report", str(page)]) in (0, 2)
    assert page.stat().st_size <= 200_000


def test_marks_tell_their_value_a_figure_zooms_and_a_table_is_sorted_and_all_return(folder, browser):
    page = Visit(browser, folder / "calibrate.html", 1280, "light").page
    # The dots of a group are one path of places in ten thousandths of the panel.
    plot = page.query_selector("#residuals .plot")
    plot.scroll_into_view_if_needed()
    x, y = re.match(r"M(\d+) (\d+)", plot.query_selector(".dot").get_attribute("d")).groups()
    box = plot.query_selector("svg").bounding_box()
    page.mouse.move(box["x"] + box["width"] * int(x) / 1e4, box["y"] + box["height"] * int(y) / 1e4)
    assert re.fullmatch(r"(cross-validated, )?pose 1: −?\d+\.\d+ ± \d+\.\d+ mm/s²", page.inner_text("#tip"))
    assert page.locator("#residuals .plot .on").count() == 1
    svg, ticks = "#residuals .plot > svg", "#residuals .xticks"
    whole, before = page.get_attribute(svg, "viewBox"), page.inner_text(ticks)
    page.click("#residuals .tools button[aria-label^='Zoom in']")
    assert page.get_attribute(svg, "viewBox") != whole
    assert page.inner_text(ticks) != before
    page.click("#residuals .tools button[aria-label^='Whole figure']")
    assert page.get_attribute(svg, "viewBox") == whole
    page.query_selector("summary:has-text('of every pose')").click()
    table = page.query_selector("details[open] table")
    cells = "(t) => [...t.tBodies[0].rows].map((r) => r.cells[4].textContent)"
    before = page.evaluate(cells, table)
    sort = table.query_selector("thead th:nth-child(5) button")
    sort.click()
    values = [float(c.split(" ")[0].replace("−", "-")) for c in page.evaluate(cells, table)]
    assert values == sorted(values)
    assert table.query_selector("th[aria-sort=ascending]") is not None
    sort.click()
    sort.click()
    assert page.evaluate(cells, table) == before
    page.close()
