"""Every kind of report in a real browser: no error, no request, nothing beyond the edge of a phone, no barrier."""

import json
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from trihedron.cli import main
from trihedron.files.log import write_recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine"),
    pytest.mark.skipif(find_spec("playwright") is None, reason="playwright is not installed (extra test)"),
    pytest.mark.skipif(find_spec("axe_playwright_python") is None, reason="axe-playwright-python is not installed"),
    pytest.mark.filterwarnings("default"),
]
KINDS = ("calibrate", "verify", "segment", "check", "allan", "kalman", "diagnose", "simulate", "plan")
GRAVE = ("serious", "critical")
# What a reader of a report meets on a phone, on a desk, in the dark.
VIEWS = ((390, "light"), (1280, "dark"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One report of every kind, on simulated logs."""
    made = tmp_path_factory.mktemp("reports")
    first, second, rest, cal = (str(made / name) for name in ("log.csv", "other.csv", "rest.npz", "cal.json"))
    for path, n, seed in ((first, 16, 3), (second, 12, 9)):
        motion = hand_session(n_poses=n, pose_s=3.0, move_s=1.5, first_pose_s=5.0)
        write_recording(simulate(replace(scenario_by_name("hand-session"), motion=motion), seed)[0], Path(path))
    rng = np.random.default_rng(4)
    np.savez(
        rest,
        t=np.arange(60_000) / 100.0,
        gx=1e-3 * rng.normal(size=60_000), gy=1e-3 * rng.normal(size=60_000), gz=1e-3 * rng.normal(size=60_000),
        ax=1e-2 * rng.normal(size=60_000), ay=1e-2 * rng.normal(size=60_000), az=9.8 + 1e-2 * rng.normal(size=60_000),
    )  # fmt: skip
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
    return made


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
    """A page opened, with everything that it said and asked for."""

    def __init__(self, browser, path, width, scheme):
        self.said, self.asked = [], []
        self.page = browser.new_page(viewport={"width": width, "height": 844}, color_scheme=scheme)
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(path.as_uri())


@pytest.mark.parametrize("kind", KINDS)
def test_a_report_works_on_a_phone_and_in_the_dark_and_has_no_barrier(folder, browser, axe, kind):
    for width, scheme in VIEWS:
        visit = Visit(browser, folder / f"{kind}.html", width, scheme)
        page = visit.page
        for closed in page.query_selector_all("summary"):
            closed.click()
        assert page.evaluate("document.documentElement.scrollWidth") <= width, (kind, width)
        page.evaluate(axe)
        found = json.loads(page.evaluate("axe.run().then((r) => JSON.stringify(r.violations))"))
        grave = [(v["id"], v["nodes"][0]["html"][:160]) for v in found if v["impact"] in GRAVE]
        assert not grave, (kind, scheme, grave)
        assert visit.said == []
        assert visit.asked == [(folder / f"{kind}.html").as_uri()]
        page.close()


@pytest.mark.parametrize("kind", KINDS)
def test_every_table_has_a_caption(folder, kind):
    # A table without one is announced as a mere table.
    assert 'aria-label="table"' not in (folder / f"{kind}.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["calibrate", "allan", "kalman", "diagnose", "plan", "check", "segment", "verify"])
def test_the_first_screen_says_what_to_do(folder, browser, kind):
    visit = Visit(browser, folder / f"{kind}.html", 1280, "light")
    told = [box for part in (".foremost", ".next") if (box := visit.page.query_selector(part)) is not None]
    assert told
    assert all(0 < box.bounding_box()["y"] < 400 for box in told)
    assert any("→" in box.inner_text() for box in told)
    visit.page.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_fits_the_paper(folder, browser, kind):
    # A4 less margins of 13 mm: 184 mm at 96 to the inch.
    page = Visit(browser, folder / f"{kind}.html", 695, "light").page
    page.emulate_media(media="print")
    assert page.evaluate("document.documentElement.scrollWidth") <= 695
    page.close()


@pytest.mark.parametrize("kind", ["calibrate", "diagnose"])
def test_tools_of_a_figure_hide_no_mark_on_a_phone(folder, browser, kind):
    page = Visit(browser, folder / f"{kind}.html", 390, "light").page
    for panel in page.query_selector_all("header .panel"):
        tools, plot = panel.query_selector(".tools").bounding_box(), panel.query_selector(".plot").bounding_box()
        assert tools["y"] + tools["height"] <= plot["y"] + 1.0
    page.close()


@pytest.mark.parametrize("kind", ["calibrate", "allan", "diagnose"])
def test_the_verdict_the_number_and_its_figure_are_on_the_first_screen(folder, browser, kind):
    visit = Visit(browser, folder / f"{kind}.html", 1280, "light")
    for part in (".verdict", ".number .value", "header .plot"):
        box = visit.page.query_selector(part).bounding_box()
        assert 0 < box["y"] < 800
        assert box["height"] > 10
    visit.page.close()


def test_a_point_tells_its_value_and_a_figure_zooms_and_returns(folder, browser):
    page = Visit(browser, folder / "calibrate.html", 1280, "light").page
    dot = page.query_selector("#residuals .plot .dot").bounding_box()
    page.mouse.move(dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2)
    assert "mm/s²" in page.inner_text("#tip")
    svg, ticks = "#residuals .plot > svg", "#residuals .xticks"
    whole, before = page.get_attribute(svg, "viewBox"), page.inner_text(ticks)
    page.click("#residuals .tools button[aria-label^='Zoom in']")
    assert page.get_attribute(svg, "viewBox") != whole
    assert page.inner_text(ticks) != before
    page.click("#residuals .tools button[aria-label^='Whole figure']")
    assert page.get_attribute(svg, "viewBox") == whole
    page.close()


def test_a_table_is_sorted_by_its_numbers_and_back(folder, browser):
    page = Visit(browser, folder / "calibrate.html", 1280, "light").page
    summary = page.query_selector("summary:has-text('of every pose')")
    summary.click()
    table = page.query_selector("details[open] table")
    cells = "(t) => [...t.tBodies[0].rows].map((r) => r.cells[4].textContent)"
    before = page.evaluate(cells, table)
    table.query_selector("thead th:nth-child(5) button").click()
    values = [float(c.split(" ")[0].replace("−", "-")) for c in page.evaluate(cells, table)]
    assert values == sorted(values)
    assert table.query_selector("th[aria-sort=ascending]") is not None
    for _ in range(2):
        table.query_selector("thead th:nth-child(5) button").click()
    assert page.evaluate(cells, table) == before
    page.close()
