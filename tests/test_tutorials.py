"""Every command and every line of Python that a tutorial or the worked example shows is run, in an empty folder."""

import ast
import contextlib
import io
import json
import re
import shlex
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import trihedron
from board import counts_recording
from test_read_ecosystems import write_bag
from trihedron.capture import open_source
from trihedron.cli import main
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.page import to_html
from trihedron.simulate.device.faults import Sent
from trihedron.simulate.device.serving import Device

mpl.use("Agg")
DOCS = Path(__file__).parents[1] / "docs"
# What follows the language of a fence is shown to the reader as text by the site's Markdown: hence a comment above it,
# such as ``not-run``, ``exit=2`` or the name of a file.
BLOCK = re.compile(r"^(?:<!-- ([^\n]*) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
PAGE = DOCS / "worked-example.md"


def blocks(page, language):
    """Fenced blocks of a language, each with the comment above it."""
    return [(said, text) for said, of, text in BLOCK.findall(page.read_text(encoding="utf-8")) if of == language]


def commands(body):
    for line in body.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            assert words[0] == "trihedron", f"a tutorial shows a command that is not run here: {line}"
            yield words[1:]


@pytest.mark.parametrize("path", TUTORIALS, ids=[path.stem for path in TUTORIALS])
def test_what_the_tutorial_shows_runs_as_shown(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    n_run = 0
    for said_of_it, language, body in BLOCK.findall(path.read_text(encoding="utf-8")):
        if language not in ("sh", "python") or said_of_it == "not-run":
            continue  # a block of a real board or a real log
        if language == "python":
            exec(compile(body, path.name, "exec"), names)
            # What a comment promises is what is printed.
            promised = re.findall(r"# → (.*)$", body, re.MULTILINE)
            assert not promised or capsys.readouterr().out.splitlines() == promised
            n_run += 1
            continue
        shown = list(commands(body))
        for i, words in enumerate(shown):
            got = main(words)
            said = capsys.readouterr()
            # A block says the status of its last command.
            expected = int(next(iter(re.findall(r"exit=(\d)", said_of_it)), 0)) if i == len(shown) - 1 else 0
            assert got == expected, f"trihedron {shlex.join(words)}\n{said.out}\n{said.err}"
            n_run += 1
    assert n_run >= 3
    # Files that the text names as results exist.
    for name in re.findall(r"<!-- makes (\S+) -->", path.read_text(encoding="utf-8")):
        assert (tmp_path / name).stat().st_size > 0, name


def test_the_notebook_runs_and_was_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document = json.loads((DOCS / "tutorials" / "notebook.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    names = {}
    for cell in cells:
        assert not any(given["output_type"] == "error" for given in cell["outputs"])
        *body, last = ast.parse("".join(cell["source"])).body
        shown, printed = None, io.StringIO()
        with contextlib.redirect_stdout(printed):
            if isinstance(last, ast.Expr):
                exec(compile(ast.Module(body, []), "cell", "exec"), names)
                shown = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
            else:
                exec(compile(ast.Module([*body, last], []), "cell", "exec"), names)
        kept = {kind: "".join(one) for given in cell["outputs"] for kind, one in given.get("data", {}).items()}
        said = "".join("".join(given.get("text", ())) for given in cell["outputs"])
        assert words_of(said) == words_of(printed.getvalue())
        if shown is not None:
            assert words_of(kept["text/plain"]) == words_of(repr(shown))
        if "text/html" in kept:
            assert words_of(kept["text/html"]) == words_of(shown._repr_html_())


def words_of(text):
    """A text without its figures, whose last digits are another machine's, and without the layout of a page."""
    return re.findall(r"[^\W\d_]{3,}", re.sub(r"<(style|script|svg)\b.*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL))


@pytest.mark.parametrize("page", ["README.md", "docs/python.md", "docs/noise.md"])
def test_the_python_of_a_page_runs_on_logs_of_its_names(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # In SI, as most logs are: the estimators' formats have no counts.
    assert main(["simulate", "--template", "si.toml"]) == 0
    for seed, name in ((3, "log.csv"), (4, "second-session.csv")):
        assert main(["simulate", "si.toml", "--seed", str(seed), "-o", name]) == 0
    force = np.random.default_rng(1).normal([0.0, 0.0, 9.81], 0.02, (6000, 3))
    rate = np.random.default_rng(2).normal(0.0, 0.001, (6000, 3))
    trihedron.convert(trihedron.Recording.from_arrays(np.arange(6000) / 100.0, force, rate), "static.csv")
    shown = blocks(DOCS.parent / page, "python")
    assert shown
    for _, text in shown:
        exec(compile(text, page, "exec"), {})


def python_of(page):
    ((_, text),) = blocks(DOCS / page, "python")
    return compile(text, page, "exec")


def test_every_way_to_read_a_log_runs_as_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(4)
    t = np.arange(500) / 100.0
    acc, gyr = rng.normal([0.0, 0.0, 9.81], 0.02, (500, 3)), rng.normal(0.0, 0.001, (500, 3))
    table = np.column_stack([t, acc, gyr])
    np.savetxt("log.csv", table, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
    np.savetxt("log.txt", np.column_stack([np.arange(500), np.zeros(500), acc, gyr]))
    for name, values in (("acc.csv", acc), ("gyro.csv", gyr)):
        np.savetxt(name, np.column_stack([t, values]), delimiter=",", header="t,x,y,z", comments="")
    np.savez("board.npz", inertial=np.repeat(table[:, None, 1:], 4, axis=1), fs=100.0)
    write_bag(tmp_path / "flight.bag", {"/imu/data_raw": table}, kind="ros1")
    exec(python_of("reading.md"), {"trihedron": trihedron, "t": t, "acc": acc, "gyr": gyr})


def test_capture_in_python_runs_as_shown(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    stream = b"".join(piece for _, piece in Device(counts_recording(300, 100.0), "lines").pieces(Sent()))
    Path("stream.txt").write_bytes(stream)
    # In place of the board at the port.
    monkeypatch.setattr(sys.modules["trihedron.capture"], "open_source", lambda _port: open_source("stream.txt"))
    exec(python_of("capture.md"), {})
    assert len(capsys.readouterr().out.splitlines()) > 0
    assert trihedron.read("log.csv").n_samples == 300


@pytest.mark.slow
def test_the_commands_of_the_worked_example_end_in_a_scenario_that_passes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")  # as the page shows it
    for name, text in blocks(PAGE, "toml"):
        Path(name).write_text(text, encoding="utf-8")
    said = []
    for _, text in blocks(PAGE, "sh"):
        words = shlex.split(text)
        assert words[0] == "trihedron"
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            status = main(words[1:])
        assert not status, text
        said.append(out.getvalue())
    assert len(said) == 6  # one that represents the recording, and five
    promised = blocks(PAGE, "text")[0][1]
    shown = " ".join(said[2].split())
    assert "the model lacks gyro g-sensitivity" in shown
    assert "gyro bias X 0.0000 °/s −7.86" in shown
    assert promised in said[3]
    assert Path("extended.json").is_file()


@pytest.mark.usefixtures("without_corners", "few_simulations")
def test_the_same_in_python_ends_the_same_way_and_counts_are_held_at_their_own_mean_scale(tmp_path, monkeypatch):
    """The script with sessions shorter than they are printed."""
    monkeypatch.chdir(tmp_path)
    script = (DOCS / "tutorials" / "simulation_against_recording.py").read_text(encoding="utf-8")
    session = 'kind = "hand"\\n'
    assert script.count(session) == 2
    left = {}
    script = script.replace(session, session + "n_poses = 12\\npose_s = 4\\n")
    exec(compile(script, "simulation_against_recording.py", "exec"), left)
    found = left["found"]
    assert [e.id for e in found.effects] == ["gyro-g-sensitivity"]
    assert left["again"].verdict == "consistent"
    as_given = {seen.domain: seen.rms for seen in found.stages[0].domains}
    # Zeros of 0.35 m/s² and scales 1.4 % apart; counts taken for m/s² would be 16000 m/s² wrong.
    assert 0.05 < as_given["static-accel"] < 0.5
    assert as_given["moves"] < 10.0
    page = to_html(diagnosis_report(found))
    low = [float(v) for v in re.findall(r'data-y="(\S+) \S+" data-ux="m/s²" data-uy="°/s"', page)]
    # 0.3 · 10⁻³ (rad/s)/(m/s²) times 10.6 m/s² is 0.18 °/s.
    assert len(low) == 3
    assert 0.1 < -min(low) < 0.3
