"""The calibration file, and files of other programs: what is written is read back, what is damaged is refused."""

import json
import math
from dataclasses import fields, replace
from functools import reduce
from importlib.resources import files
from operator import getitem

import numpy as np
import pytest
import yaml

import trihedron
from small_session import rejected, usual
from test_export import NOISE, READINGS, ROUNDING, calibration, corrected, with_g_sensitivity
from trihedron import calibrate
from trihedron.cli import main
from trihedron.files.calibration import (
    CalibrationFileError,
    calibration_document,
    read_calibration,
    schema_of,
    write_calibration,
)
from trihedron.files.formats import any_calibration, export_files, formats, is_calibration
from trihedron.records import FitQuality, diagnosis
from trihedron.records.calibration import Observability
from trihedron.records.domains import DomainResiduals, DomainTest, HeldOut, Where
from trihedron.records.finding import Finding
from trihedron.records.plain import as_plain, from_plain
from trihedron.records.reference import Estimate, FitToReference

READ = [name for name, one in formats().items() if one.read is not None]
BOARDS = ("ardupilot", "px4")
GYRO_LOST = ("imu_calib",)


def angles(sensor):
    """What no choice of frame changes: SᵀS, and the reading that means zero."""
    return sensor.S.T @ sensor.S, np.linalg.solve(sensor.S, sensor.b)


@pytest.mark.parametrize("unit", ["si", "counts"])
@pytest.mark.parametrize("target", READ)
def test_a_calibration_is_read_back_from_the_file_of_another_program(target, unit, tmp_path):
    known = calibration(unit)
    if target in BOARDS:
        # Their equation has scales of the accelerometer and offsets.
        a, w = known.accelerometer, known.gyroscope
        known = replace(known, accelerometer=replace(a, S=np.diag(np.diag(a.S))), gyroscope=replace(w, S=np.eye(3)))
    if unit == "counts" and formats()[target].in_si:
        pytest.skip("takes readings in SI")
    if target in ("kalibr", "openvins", "imucal"):
        known, G = with_g_sensitivity(known)
    made = export_files(known, target, replace(NOISE, current_parameters="none"))
    for ending, text in made.items():
        (tmp_path / f"unit{ending}").write_text(text)
    path = tmp_path / f"unit{next(iter(made))}"
    assert is_calibration(path)
    back = any_calibration(path)
    assert back.extensions["maker"] == target
    pairs = [(known.accelerometer, back.accelerometer), (known.gyroscope, back.gyroscope)]
    for mine, read in pairs[: 1 if target in GYRO_LOST else 2]:
        assert read.raw_unit == mine.raw_unit
        # Residue of writing all digits and inverting matrices of condition 1.1, relative to the size of S.
        tolerance = {"rtol": 1e-9, "atol": 1e-12 * np.linalg.norm(mine.S)}
        for wanted, got in zip(angles(mine), angles(read), strict=True):
            np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
        if target != "imu_tk":
            np.testing.assert_allclose(read.S, mine.S, **tolerance)
    # Both sensors are turned alike where the format has a frame of its own.
    if target not in (*GYRO_LOST, *BOARDS):
        relative = [np.linalg.solve(w.S, a.S) for a, w in ((s[0][0], s[1][0]) for s in [pairs])]
        read = np.linalg.solve(back.gyroscope.S, back.accelerometer.S)
        np.testing.assert_allclose(read, relative[0], rtol=1e-9, atol=1e-11)
    if "effects" in known.extensions:
        values = back.extensions["effects"][0]["model"]["values"]
        np.testing.assert_allclose(np.reshape(values, (3, 3)), G, atol=1e-14)
        log = trihedron.read({"t": np.arange(40) / 100, "acc": READINGS, "gyr": READINGS},
                             accelerometer_unit="m/s^2", gyroscope_unit="rad/s")  # fmt: skip
        if unit == "si":
            force = corrected(back.accelerometer)
            made = trihedron.apply(back, log).gyroscope
            wanted = corrected(back.gyroscope) - force @ np.reshape(values, (3, 3)).T
            np.testing.assert_allclose(made, wanted, **ROUNDING)


def test_results_of_kalibr_as_its_writer_dumps_them_with_a_second_imu_and_no_bias(tmp_path):
    """``kalibr_calibrate_imu_camera`` dumps a mapping of IMUs by PyYAML: block lists in block lists, words sorted."""
    known, G = with_g_sensitivity(calibration("si"))
    flat = yaml.safe_load(export_files(known, "kalibr", NOISE)[""])
    for sensor in ("accelerometers", "gyroscopes"):
        del flat[sensor]["b"]
    result = {"imu0": {"T_i_b": np.eye(4).tolist(), "time_offset": 0.0, **flat}}
    result["imu1"] = {**result["imu0"], "accelerometers": {"M": (2 * np.eye(3)).tolist()}}
    for style in (None, False):
        path = tmp_path / f"log-imu-{style}.yaml"
        path.write_text(yaml.dump(json.loads(json.dumps(result)), default_flow_style=style))
        back = any_calibration(path)
        np.testing.assert_allclose(back.accelerometer.S, known.accelerometer.S, atol=1e-12)
        np.testing.assert_allclose(back.gyroscope.S, known.gyroscope.S, atol=1e-12)
        values = back.extensions["effects"][0]["model"]["values"]
        np.testing.assert_allclose(np.reshape(values, (3, 3)), G, atol=1e-14)
        assert back.extensions["without_bias"] == ("accelerometer", "gyroscope")


def test_a_file_of_where_the_imu_sits_is_refused_with_what_it_lacks_and_a_yaml_in_braces_is_none(tmp_path):
    """Kalibr's camera chain holds pose and delay of the IMU, nothing of its readings."""
    chain = {"T_cam_imu": np.eye(4).tolist(), "camera_model": "pinhole", "timeshift_cam_imu": 0.0021}
    (tmp_path / "camchain-imucam.yaml").write_text(yaml.dump({"cam0": chain}))
    with pytest.raises(ValueError, match=r"(?s)Kalibr.*no scale, misalignment or bias"):
        any_calibration(tmp_path / "camchain-imucam.yaml")
    assert is_calibration(tmp_path / "camchain-imucam.yaml")
    known = yaml.safe_load(export_files(calibration("si"), "kalibr", NOISE)[""])
    (tmp_path / "imu.yaml").write_text(yaml.dump({"imu0": known}, default_flow_style=True))
    assert not is_calibration(tmp_path / "imu.yaml")


def test_realsense_stores_the_transpose():
    """The maker's script fits raw · X - bias to the truth and stores X row by row."""
    known = calibration("si")
    imu = json.loads(export_files(known, "realsense", NOISE)[""])["imus"][0]
    X, bias = np.reshape(imu["accelerometer"]["scale_and_alignment"], (3, 3)), imu["accelerometer"]["bias"]
    np.testing.assert_allclose(READINGS @ X - bias, corrected(known.accelerometer), **ROUNDING)


def test_imucal_calibrates_as_its_own_functions_do():
    """acc = (K R)⁻¹ (raw - b); gyr in deg/s = (K R)⁻¹ (raw - b - K_ga acc)."""
    known, G = with_g_sensitivity(calibration("counts"))
    p = {k: np.array(v) for k, v in json.loads(export_files(known, "imucal")[""]).items() if not isinstance(v, str)}
    acc = (READINGS - p["b_a"]) @ np.linalg.inv(p["K_a"] @ p["R_a"]).T
    np.testing.assert_allclose(acc, corrected(known.accelerometer), **ROUNDING)
    gyr = (READINGS - p["b_g"] - acc @ p["K_ga"].T) @ np.linalg.inv(p["K_g"] @ p["R_g"]).T
    np.testing.assert_allclose(np.radians(gyr), corrected(known.gyroscope) - acc @ G.T, **ROUNDING)


@pytest.mark.parametrize(
    "target", ["kalibr", "openvins", "vins-fusion", "ros", "orb-slam3", "lio-sam", "fast-lio", "gtsam", "gazebo"]
)
def test_a_target_that_cannot_do_without_noise_asks_for_it(target):
    with pytest.raises(ValueError, match="--noise"):
        export_files(calibration("si"), target)


def test_the_result_of_imucal_on_a_recording_is_read(real_data):
    file = real_data / "imucal_ferraris" / "ferraris_result_imucal260.json"
    back = any_calibration(file)
    assert (back.accelerometer.raw_unit, back.gyroscope.raw_unit) == ("m/s^2", "deg/s")
    p = {k: np.array(v) for k, v in json.loads(file.read_text()).items() if isinstance(v, list)}
    acc = (READINGS - p["b_a"]) @ (np.linalg.inv(p["R_a"]) @ np.linalg.inv(p["K_a"])).T
    np.testing.assert_allclose(READINGS @ back.accelerometer.S.T + back.accelerometer.b, acc, **ROUNDING)


def test_the_list_of_targets_says_what_each_needs_and_files_out_of_order_are_refused(tmp_path, capsys):
    assert main(["export", "--to", "list"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:])
    assert listed["kalibr*"] == "--noise --rate"
    assert listed["px4*"] == "--current-parameters"
    assert listed["c"] == "–"
    assert "name a calibration file" in rejected(capsys, "export", "--to", "c")
    (tmp_path / "log.csv").write_text("t,ax,ay,az\n0,0,0,9.8\n")
    assert "it comes before the log" in rejected(capsys, "apply", tmp_path / "log.csv", "cal.json")


OF_DIAGNOSIS = {
    "where": Where, "domain": DomainTest, "heldout": HeldOut, "parameter": diagnosis.EffectParameter,
    "effect": diagnosis.AcceptedEffect, "candidate": diagnosis.Candidate, "linear": diagnosis.LinearModel,
    "residuals": DomainResiduals, "finding": Finding, "parameter_difference": diagnosis.ParameterDifference,
    "noise_difference": diagnosis.NoiseDifference, "relation": diagnosis.Relation, "stage": diagnosis.Stage,
    "estimate": Estimate, "against_reference_sensor": FitToReference,
}  # fmt: skip
OF_CALIBRATION = {"residuals": FitQuality, "observability": Observability}
EVERY = [("diagnosis", *item) for item in OF_DIAGNOSIS.items()]
EVERY += [("calibration", *item) for item in OF_CALIBRATION.items()]


def same(a, b):
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, float) and np.isnan(a):
        return np.isnan(b)
    return a == b


def test_a_round_trip_gives_back_every_number_exactly(tmp_path):
    calibration = usual()[1].calibration
    write_calibration(calibration, tmp_path / "c.json")
    back = read_calibration(tmp_path / "c.json")
    assert np.array_equal(back.covariance, calibration.covariance)
    for name in ("accelerometer", "gyroscope"):
        was, now = getattr(calibration, name), getattr(back, name)
        assert all(same(getattr(was, key), getattr(now, key)) for key in ("S", "b", "covariance", "raw_unit", "method"))
        for part in ("quality", "observability"):
            before, after = vars(getattr(was, part)), vars(getattr(now, part))
            assert before.keys() == after.keys()
            assert all(same(before[key], after[key]) for key in before), part
    rest = ("frame", "gravity_m_s2", "gravity_source", "recording_source", "recording_sha256", "findings")
    assert all(getattr(back, key) == getattr(calibration, key) for key in rest)
    alone = calibrate(replace(usual()[0], gyroscope=None), gravity_m_s2=9.80665).calibration
    write_calibration(alone, tmp_path / "alone.json")
    assert read_calibration(tmp_path / "alone.json").gyroscope is None
    assert np.array_equal(read_calibration(tmp_path / "alone.json").covariance, alone.covariance)


def test_the_file_follows_its_own_schema_and_states_equation_direction_and_units():
    import jsonschema

    document = json.loads(json.dumps(calibration_document(usual()[1].calibration)))
    jsonschema.Draft202012Validator.check_schema(schema_of("calibration"))
    jsonschema.validate(document, schema_of("calibration"), cls=jsonschema.Draft202012Validator)
    assert document["format_version"] == 1
    assert document["equation"] == "truth = S * raw + b"
    assert "raw to true" in document["direction"]
    assert document["accelerometer"]["raw_unit"] == "counts"
    assert document["parameter_order"][:2] == ["accelerometer.S_xx", "accelerometer.S_xy"]
    assert np.shape(document["covariance"]) == (24, 24)
    assert len(document["recording"]["sha256"]) == 64


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("format",), "something else", "not a calibration"),
        (("format_version",), 99, "update trihedron"),
        (("equation",), "truth = S * (raw - b)", "states the equation"),
        (("accelerometer", "S"), [[1.0, 0.0], [0.0, 1.0]], "accelerometer.S"),
        (("accelerometer", "b"), None, "'b' is a required property"),
        (("accelerometer", "raw_unit"), "furlongs", "accelerometer.raw_unit"),
        (("covariance",), [[1.0]], "covariance must be 24 x 24"),
        (("gravity_m_s2",), -9.8, "gravity_m_s2"),
        (("parameter_order",), ["b_x"], "parameter_order"),
        (("frame",), "sideways", "frame"),
    ],
)
def test_a_changed_file_is_refused_with_the_place_named(tmp_path, path, value, said):
    document = json.loads(json.dumps(calibration_document(usual()[1].calibration)))
    at = reduce(getitem, path[:-1], document)
    at[path[-1]] = value
    if value is None:
        del at[path[-1]]
    file = tmp_path / "c.json"
    file.write_text(json.dumps(document))
    with pytest.raises(CalibrationFileError, match=r"c\.json") as caught:
        read_calibration(file)
    assert said in str(caught.value)


@pytest.mark.parametrize(("which", "name", "record"), EVERY, ids=lambda v: getattr(v, "__name__", v))
def test_a_schema_names_what_its_record_writes(which, name, record):
    text = files("trihedron.files").joinpath("schema", f"{which}.schema.json").read_text(encoding="utf-8")
    stated = json.loads(text)["$defs"][name]["properties"]
    layout = getattr(record, "LAYOUT", None)
    names = {layout.names.get(field.name, field.name) if layout else field.name for field in fields(record)}
    # What a layout adds is checked where a document is written.
    assert set(stated) == names if layout is None else set(stated) >= names - set(layout.left_out)


def quality(**more):
    return FitQuality("m/s^2", np.array([0.1, -0.2]), np.array([0.1, 0.1]), 5.0, 1, 0.16, 0.2, 0.1, **more)


def test_null_is_no_finite_number_and_what_may_be_absent_stays_so():
    back = from_plain(as_plain(quality()) | {"chi2": None, "residual": [None, 1.0]}, FitQuality)
    assert math.isnan(back.chi2)
    assert math.isnan(back.residual[0])
    assert back.held_out is back.held_out_rms is None
    finding = Finding("time-gap", "note", "seen", numbers={"x": math.nan})  # type: ignore[arg-type]
    assert math.isnan(from_plain(finding.to_dict() | {"numbers": {"x": None}}, Finding).numbers["x"])


@pytest.mark.parametrize("harm", [{"surprise": 1}, {"dof": None}, {"chi2": "much"}, {"residual": "x"}])
def test_an_entry_that_is_no_such_record_is_refused(harm):
    with pytest.raises((ValueError, TypeError)):
        from_plain(as_plain(quality()) | harm, FitQuality)
    with pytest.raises(KeyError):
        from_plain({"unit": "m/s^2"}, FitQuality)
