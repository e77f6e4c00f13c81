"""``trihedron diagnose``: a log in; verdict, report, JSON and pictures out; extended calibrations applied."""

import json

import numpy as np
import pytest

import trihedron
from trihedron.cli import main
from trihedron.diagnosis_file import complaint_about, read_diagnosis, schema
from trihedron.log_file import write_recording
from trihedron.records.diagnosis import Diagnosis
from trihedron.simulate import hand_session, profile_by_name, simulate, with_effect
from trihedron.simulate.scenario import Scenario

K2 = (3e-4, -2e-4, 2e-4)
GRAVITY = ("--gravity", "9.80665")


def scenario(seed=1, layout=1):
    profile = profile_by_name("mpu")
    accelerometer, gyroscope = profile.unit(seed)
    return Scenario(hand_session(24, layout=layout), "session", accelerometer, gyroscope, profile.clock)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("diagnose")
    bent = with_effect(scenario(), "accel-quadratic", k2=K2)
    for name, what, seed in (
        ("healthy", scenario(), 1),
        ("bent", bent, 1),
        ("again", with_effect(scenario(layout=2), "accel-quadratic", k2=K2), 2),
        ("simulated", scenario(), 3),
    ):
        write_recording(simulate(what, seed)[0], where / f"{name}.csv")
    return where


@pytest.fixture(scope="module")
def said(folder):
    """The command on the bent log, once for all."""
    target, page = folder / "bent.json", folder / "bent.html"
    status = main(["diagnose", str(folder / "bent.csv"), *GRAVITY, "--json", str(target), "--report", str(page)])
    return status, json.loads(target.read_text()), page.read_text()


def test_the_command_ends_with_zero_and_names_the_effect_though_physics_is_missing(said):
    status, document, _ = said
    assert status == 0
    assert document["verdict"] == "missing-physics"
    assert document["effects"][0]["id"] == "accel-quadratic"


def test_the_json_follows_the_published_schema_and_has_the_fields_of_the_contract(said):
    _, document, _ = said
    assert complaint_about(document) == ""
    contract = {"verdict", "domains", "effects", "remaining", "candidates", "calibration", "noise", "schema_version"}
    assert contract <= set(document)
    assert contract <= set(schema()["required"])
    effect = document["effects"][0]
    assert {"id", "statement", "parameters", "p_adjusted", "delta_bic", "heldout", "confounded_with"} <= set(effect)
    assert effect["heldout"]["chi2_per_dof_after"] < 1.3 < effect["heldout"]["chi2_per_dof_before"]


def test_json_has_null_for_what_is_not_finite_and_a_document_with_a_wrong_verdict_is_refused(said, folder):
    _, document, _ = said

    def refuse(name):
        raise AssertionError(name)

    json.loads((folder / "bent.json").read_text(), parse_constant=refuse)
    assert complaint_about({**document, "verdict": "maybe"}).startswith("verdict")


def test_the_page_needs_no_other_file_and_shows_every_domain_before_and_after(said):
    _, document, page = said
    assert page.count("data:image/png;base64,") == len(document["residuals"]) == 4
    assert "http" not in page.split("<style>")[0]
    for entry in document["residuals"]:
        before, after = np.array(entry["before"]), np.array(entry["after"])
        assert before.shape == after.shape
        assert np.isfinite(before).all()
    norm = next(entry for entry in document["residuals"] if entry["domain"] == "static-accel")
    # Poses that a quadratic of this size bends by several sigma lie within noise afterwards.
    assert np.sqrt(np.mean(np.square(norm["after"]))) < 0.7 * np.sqrt(np.mean(np.square(norm["before"])))


def test_print_reads_as_a_short_report_and_python_gives_a_diagnosis(folder):
    found = trihedron.diagnose(folder / "healthy.csv", gravity_m_s2=9.80665)
    assert isinstance(found, Diagnosis)
    assert isinstance(found, trihedron.Diagnosis)
    assert found.verdict == "consistent"
    text = str(found)
    assert "CONSISTENT" in text
    assert len(text.splitlines()) < 40
    assert "0x" not in repr(found)


def test_json_alone_goes_to_stdout_and_nothing_else_does(folder, capsys):
    assert main(["diagnose", str(folder / "healthy.csv"), *GRAVITY, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "consistent"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["nowhere.csv"], "nowhere.csv"),
        (["{healthy}", "--alpha", "2"], "alpha"),
        (["{healthy}", "--calibration", "c.json", "--against", "{simulated}"], "either"),
        (["{healthy}", "--report", "report.pdf"], ".html"),
        (["{healthy}", "--json", "{healthy}"], "exists"),
        (["{healthy}", "--against", "nowhere.csv"], "nowhere.csv"),
    ],
)
def test_a_question_that_cannot_be_answered_is_refused_in_one_sentence(folder, capsys, words, complaint):
    paths = {name: str(folder / f"{name}.csv") for name in ("healthy", "simulated")}
    assert main(["diagnose", *(word.format(**paths) for word in words), *GRAVITY]) == 1
    err = capsys.readouterr().err.strip()
    assert complaint in err
    assert "Traceback" not in err


def test_the_users_own_simulation_is_the_model_and_its_difference_is_named(folder):
    same = trihedron.diagnose(folder / "healthy.csv", against=folder / "simulated.csv", gravity_m_s2=9.80665)
    assert same.model_is_given
    assert same.verdict == "consistent"
    other = trihedron.diagnose(folder / "bent.csv", against=folder / "simulated.csv", gravity_m_s2=9.80665)
    assert other.effects[0].id == "accel-quadratic"


def test_a_diagnosis_file_is_checked_when_read(said, folder, tmp_path):
    assert read_diagnosis(folder / "bent.json") == said[1]
    for text, complaint in (("{", "not JSON"), ("{}", "not a diagnosis"), ('{"verdict": 1}', "schema")):
        bad = tmp_path / "bad.json"
        bad.write_text(text)
        with pytest.raises(ValueError, match=complaint):
            read_diagnosis(bad)
    with pytest.raises(ValueError, match="no such file"):
        read_diagnosis(tmp_path / "nowhere.json")
