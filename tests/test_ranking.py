"""Several calibrations of one unit: the right one first, each wrong one rejected with its reason."""

import json
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from test_export import export_calibration
from trihedron.cli import main
from trihedron.files.formats.contract import ExportOptions, NoiseFigure, SensorNoise
from trihedron.records import Recording, Severity
from trihedron.report.ranking import said_of

RATE = "static-rate-above-noise"


def check_ranked(known, log, gravity):
    """Of the same calibration with one mistake each, by the mistake's name, and the right one."""
    a, w = known.accelerometer, known.gyroscope
    used = 9.95 / gravity
    wrong = {
        "bias-sign": replace(known, accelerometer=replace(a, b=-a.b)),
        "unit": replace(known, accelerometer=replace(a, S=a.S / 9.80665, b=a.b / 9.80665)),
        "gravity": replace(known, accelerometer=replace(a, S=a.S * used, b=a.b * used)),
        "axes": replace(known, gyroscope=replace(w, S=w.S @ np.eye(3)[[1, 0, 2]])),
        "gyro-unit": replace(known, gyroscope=replace(w, S=np.degrees(w.S), b=np.degrees(w.b))),
    }
    ranking = trihedron.rank([*wrong.values(), known], log, gravity_m_s2=gravity)
    names = dict(zip((f"calibration {k + 1}" for k in range(6)), [*wrong, "right"], strict=True))
    assert names[ranking.best.name] == "right"
    assert not ranking.best.suspicions
    for one in ranking.candidates[1:]:
        name = names[one.name]
        assert one.is_rejected, name
        assert name.removeprefix("gyro-") in [found.kind for found in one.suspicions], (name, said_of(one))


@pytest.fixture(scope="module")
def session():
    """A log, and a calibration that was made from another one of the same unit."""
    (log, _), (before, _) = (trihedron.simulate("hand-session", seed) for seed in (6, 5))
    return log, trihedron.calibrate(before, gravity_m_s2=9.81).calibration


def test_five_wrong_files_of_a_phones_imu_are_rejected_on_another_session(real_data):
    logs = [trihedron.read(real_data / "kim" / f"kim_imu_good{run}.txt") for run in (2, 3)]
    check_ranked(trihedron.calibrate(logs[0], gravity_m_s2=9.79871).calibration, logs[1], 9.79871)


def test_files_of_other_makers_are_ranked_and_what_they_do_not_hold_is_taken_from_the_log(session, tmp_path, capsys):
    log, known = session
    noise = (SensorNoise(NoiseFigure(N), NoiseFigure(N / 100.0)) for N in (1e-3, 1e-4))
    size = ExportOptions(*noise, 100.0)
    trihedron.write_calibration(known, tmp_path / "own.json")
    for target, name in (("xio", "fusion.txt"), ("imucal", "imucal.json"), ("pyins", "pyins.txt")):
        (tmp_path / name).write_text(export_calibration(known, target, size))
    off = replace(known, gyroscope=replace(known.gyroscope, b=-known.gyroscope.b))
    (tmp_path / "wrong.json").write_text(export_calibration(off, "imucal", size))
    trihedron.convert(log, tmp_path / "log.csv")
    files = [str(tmp_path / n) for n in ("log.csv", "wrong.json", "own.json", "fusion.txt", "imucal.json", "pyins.txt")]
    units = ["--accel-unit", "counts", "--gyro-unit", "counts", "--gravity", "9.81"]
    assert main(["verify", *files, *units, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [one["maker"] for one in document["candidates"]].count("imucal") == 2
    last = document["candidates"][-1]
    assert (last["name"], last["is_rejected"]) == ("wrong.json", True)
    assert [found["kind"] for found in last["mistakes"]] == ["bias-sign"]
    assert not any(one["is_rejected"] for one in document["candidates"][:-1])


def test_a_maker_who_stores_no_bias_is_judged_with_that_of_the_log(session):
    log, known = session
    a, w = (replace(sensor, b=np.zeros(3)) for sensor in (known.accelerometer, known.gyroscope))
    nothing = {"maker": "kalibr", "without_bias": ("accelerometer", "gyroscope")}
    nameless = replace(known, accelerometer=a, gyroscope=w, extensions=nothing)
    ranking = trihedron.rank([known, nameless], log, gravity_m_s2=9.81)
    assert not any(one.is_rejected for one in ranking.candidates)
    one = next(one for one in ranking.candidates if one.maker == "kalibr")
    assert "has no bias" in said_of(one)


def test_an_extended_calibration_is_ranked_on_the_poses_of_the_others(session):
    log, known = session
    bent = {"id": "accel-quadratic", "model": {"variant": "", "values": [0.0, 0.0, 0.0]}}
    extended = replace(known, extensions={"effects": [bent]})
    # Readings without the effects may be segmented into other poses than these, which are those of the first part.
    part = log.n_samples * 4 // 5
    units = {"accelerometer_unit": log.accelerometer_unit, "gyroscope_unit": log.gyroscope_unit}
    first = log.accelerometer[:part], log.gyroscope[:part]
    fewer = trihedron.segment(Recording.from_arrays(log.time_s[:part], *first, **units))
    ranking = trihedron.rank([known, extended], log, segments=fewer, gravity_m_s2=9.81)
    assert [len(one.verification.norm_error) for one in ranking.candidates] == [len(fewer.poses)] * 2


def test_verify_rejects_a_gyro_bias_that_is_wrong_and_what_is_worse_than_nothing_however_uncertain(session):
    log, known = session
    a, w = known.accelerometer, known.gyroscope
    sensors = [replace(s, S=1.05 * s.S, b=1.05 * s.b, covariance=1e4 * s.covariance) for s in (a, w)]
    wide = {"accelerometer": sensors[0], "gyroscope": sensors[1]}
    assert trihedron.verify(known, log, gravity_m_s2=9.81).is_passed
    for off, code in (
        (replace(known, gyroscope=replace(w, b=w.b + np.radians(5.0))), "calibration-shift"),
        (replace(known, **wide, covariance=1e4 * known.covariance), "worse-than-uncalibrated"),
    ):
        result = trihedron.verify(off, log, gravity_m_s2=9.81)
        assert not result.is_passed
        found = [one for one in result.findings if one.code == code and one.severity is Severity.SERIOUS]
        assert found
        # Five degrees per second beside hundredths.
        assert all(one.numbers.get("times_expected", 20.0) > 10.0 for one in found)


def test_verify_says_which_parameters_the_log_cannot_judge(session):
    log, known = session
    result = trihedron.verify(known, log, gravity_m_s2=9.81)
    assert len(result.verification.parameters) == 21
    assert all(one.is_judged for one in result.verification.parameters)
    assert all(abs(one.times_sigma) < 4 for one in result.verification.parameters if one.id != "gyro-bias")
    # A log of one pose knows the gyro's bias and nothing else.
    rest = replace(
        log, time_s=log.time_s[:300], accelerometer=log.accelerometer[:300], gyroscope=log.gyroscope[:300],
        temperature_degc=None, supply_v=None, auxiliary={},
    )  # fmt: skip
    few = trihedron.verify(known, rest, gravity_m_s2=9.81).verification.parameters
    assert not any(one.is_judged for one in few if one.id != "gyro-bias")


def test_published_results_of_imu_tk_are_found_to_be_made_with_another_gravity(real_data):
    """Its author's own files beside his recordings hold imu_tk's default of 9.81744 m/s² for 9.803: 0.15 % of scale."""
    folder = real_data / "getovermassif"
    files = [folder / f"session{k}_acc.calib" for k in (2, 3)]
    log = trihedron.read(accelerometer_path=folder / "session4_acc.txt", gyroscope_path=folder / "session4_gyro.txt")
    ranking = trihedron.rank(files, log, gravity_m_s2=9.803)
    for one in ranking.candidates:
        assert (one.maker, [found.kind for found in one.suspicions]) == ("imu_tk", ["gravity"])
        # Scales repeat to 0.03 % from session to session.
        assert one.suspicions[0].factor == pytest.approx(9.81744 / 9.803, abs=5e-4)


def test_the_recording_that_a_calibration_was_made_from_proves_nothing_of_it(session):
    """It fits best and is rejected; what fits behind it is the best."""
    log = replace(trihedron.simulate("hand-session", 6)[0], sha256="of this log")
    own = replace(trihedron.calibrate(log, gravity_m_s2=9.81).calibration, recording_sha256="of this log")
    assert not trihedron.verify(own, log).is_passed
    one_of_several = {"sessions": [{"sha256": "of another log"}, {"sha256": "of this log"}]}
    assert not trihedron.verify(replace(own, recording_sha256="", extensions=one_of_several), log).is_passed
    ranking = trihedron.rank([own, session[1]], log, gravity_m_s2=9.81)
    assert [one.name for one in ranking.candidates] == ["calibration 2", "calibration 1"]
    assert ranking.best.behind == 0.0


def test_a_gyro_bias_that_drifts_within_the_log_is_a_warning_of_its_verification(session):
    """No bias of such a log is the next one's, whatever the file states; a log without drift has no such warning."""
    log, known = session
    counts = np.radians(0.06) / np.abs(np.diag(known.gyroscope.S)) * (log.time_s / log.time_s[-1])[:, None]
    found = [
        [f.severity for f in trihedron.verify(known, one, gravity_m_s2=9.81).findings if f.code == RATE]
        for one in (log, replace(log, gyroscope=log.gyroscope + counts))
    ]
    assert found == [[], [Severity.WARNING]]


def test_verify_names_the_one_scale_that_is_wrong_and_does_not_suspect_gravity(session):
    log, known = session
    a = known.accelerometer
    off = replace(known, accelerometer=replace(a, S=np.diag([1.0, 1.05, 1.0]) @ a.S))
    found = trihedron.verify(off, log, gravity_m_s2=9.81).findings
    causes = [one.cause for one in found if one.code == "residual-above-noise"]
    assert len(causes) == 1
    assert "accelerometer scale Y" in causes[0]
    assert "gravity" not in causes[0].lower()


def test_a_gyro_bias_that_changed_alone_is_named_in_the_verdict_and_no_rejection(session):
    """0.05 °/s is fifty standard uncertainties and what a gyro does from one turn-on to the next."""
    log, known = session
    w = known.gyroscope
    moved = replace(known, gyroscope=replace(w, b=w.b + np.radians([0.0, 0.05, 0.0])))
    result = trihedron.verify(moved, log, gravity_m_s2=9.81)
    assert result.is_passed
    assert "the gyro bias changed" in " ".join(str(result).partition("Result\n")[0].split())
