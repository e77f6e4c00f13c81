"""The command ``allan`` end to end."""

import csv
import io
import json
import re
from contextlib import redirect_stdout
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from noise_coverage import in_time
from small_session import rejected
from test_export import given
from trihedron.api.identifying import allan as noise_of
from trihedron.cli import main
from trihedron.records import Recording
from trihedron.report.noise import noise_report
from trihedron.report.noise_files import curve_csv
from trihedron.units import AccelerationUnit, RateUnit

RATE = 50.0


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An hour of six axes at 50 Hz, with header."""
    rng = np.random.default_rng(31)
    n = 180_000
    gyro = [in_time(rng, n, RATE, N=2e-4, K=3e-6) for _ in range(3)]
    accel = [in_time(rng, n, RATE, N=2e-3, K=3e-5) + (9.81 if axis == 2 else 0.0) for axis in range(3)]
    path = tmp_path_factory.mktemp("noise") / "log.npz"
    names = ("gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")
    np.savez(path, t_s=np.arange(n) / RATE, **dict(zip(names, (*gyro, *accel), strict=True)))
    return path


@pytest.fixture(scope="module")
def files(log):
    """What the command writes, by its kind; "txt" is what it prints."""
    made = {kind: log.parent / f"x.{kind}" for kind in ("csv", "json", "png", "html", "txt")}
    wanted = zip(("--csv", "--json", "--plot", "--report"), made.values(), strict=False)
    with made["txt"].open("w", encoding="utf-8") as out, redirect_stdout(out):
        assert main(["allan", str(log), "--full", *(str(word) for pair in wanted for word in pair)]) == 0
    return made


def test_the_table_names_every_term_and_the_files_hold_the_same(files):
    out = files["txt"].read_text(encoding="utf-8")
    assert "export CALIBRATION" not in out  # a static log has none
    for words in ("angle random walk", "bias instability", "accelerometer_noise_density", "best averaging time"):
        assert words in out
    document = json.loads(files["json"].read_text())
    assert [axis["name"] for axis in document["axes"]][:2] == ["gyro x", "gyro y"]
    for axis in document["axes"]:
        truth = 2e-4 if axis["unit"] == "rad/s" else 2e-3
        assert axis["terms"]["B"]["limit"] == axis["terms"]["B"]["upper"] > 0.0
        assert [axis["terms"]["N"][which] for which in ("value", "fitted")] == pytest.approx([truth] * 2, rel=0.01)
        # A walk that an hour hardly shows: 1.5 hundredths of N; six intervals of 95 %, fixed by the seed.
        assert axis["terms"]["K"]["lower"] <= 0.015 * truth <= axis["terms"]["K"]["upper"]
        assert set(axis["slow_pair"]) == {"evidence", "is_present"}
    rows = list(csv.reader(io.StringIO(files["csv"].read_text())))
    assert len(rows) == 1 + len(document["curve"]["tau_s"])
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    assert files["html"].read_text().count("<figure id=") == 3  # both sensors, then each


def test_the_terms_come_back_from_the_written_curve_alone(files, capsys):
    table = files["csv"]
    assert "--samples" in rejected(capsys, "allan", table, "--curve")
    in_counts = table.with_name("counts.csv")
    in_counts.write_text(re.sub(r"\[[^]]*\]", "[counts]", table.read_text()))
    assert main(["allan", str(in_counts), "--curve", "--samples", "180000"]) == 0
    advice = capsys.readouterr().out
    assert "--gyro-unit UNIT" in " ".join(advice.split())  # at any width of the terminal
    assert "lsb" not in advice.partition("Result")[0]
    assert main(["allan", str(table), "--curve", "--samples", "180000", "--json"]) == 0
    axes = json.loads(capsys.readouterr().out)["axes"]
    for axis in axes:
        truth_n, truth_k = (2e-4, 3e-6) if axis["unit"] == "rad/s" else (2e-3, 3e-5)
        # N to 0.3 %, K to 25 % from an hour: four standard errors.
        assert axis["terms"]["N"]["value"] == pytest.approx(truth_n, rel=0.012)
        term = axis["terms"]["K"]
        assert not term["present"] or term["value"] == pytest.approx(truth_k, abs=4 * term["sigma"])


def test_the_size_of_a_count_gives_a_log_in_counts_its_units(tmp_path, capsys):
    rng = np.random.default_rng(33)
    counts = np.round(rng.normal(scale=20.0, size=(20_000, 6))).astype(np.int16)
    counts[:, 5] += 300
    path = tmp_path / "counts.npy"
    np.save(path, counts)
    said = ["--columns", "gx,gy,gz,ax,ay,az", "--rate", "100", "--gyro-lsb", "0.05 deg/s", "--accel-lsb", "3.33 mg"]
    for extra in ([], ["--stream"]):
        assert main(["allan", str(path), *said, "--json", *extra]) == 0
        axes = json.loads(capsys.readouterr().out)["axes"]
        assert [axis["unit"] for axis in axes] == ["rad/s"] * 3 + ["m/s^2"] * 3
        # 20 counts a reading at 100 Hz; 20 000 readings give N to 0.5 %.
        assert axes[0]["terms"]["N"]["value"] == pytest.approx(np.radians(0.05) * 2.0, rel=0.02)
        assert axes[5]["terms"]["N"]["value"] == pytest.approx(3.33e-3 * 9.80665 * 2.0, rel=0.02)
    assert main(["allan", str(path), *said[:4]]) == 0
    assert "--gyro-lsb GYRO_LSB --accel-lsb ACCEL_LSB" in " ".join(capsys.readouterr().out.replace("\\\n", "").split())
    assert "number and a unit" in rejected(capsys, "allan", path, *said[:-1], "3.33")
    # Readings in SI were multiplied, and N was a thousandth.
    in_si = tmp_path / "si.csv"
    header = ",".join([f"g{axis} [rad/s]" for axis in "xyz"] + [f"a{axis} [m/s^2]" for axis in "xyz"])
    np.savetxt(in_si, 1e-3 * counts[:2000], "%.6g", ",", header=header, comments="")
    assert "not in counts" in rejected(capsys, "allan", in_si, "--rate", "100", *said[4:])


def test_lost_rows_become_missing_readings_not_shorter_time():
    rng = np.random.default_rng(32)
    n = 60_000
    kept = np.ones(n, dtype=bool)
    kept[20_000:26_000] = False
    gyro = np.column_stack([in_time(rng, n, RATE, N=1e-3, K=1e-4) for _ in range(3)])
    recording = Recording(np.arange(n)[kept] / RATE, None, gyro[kept], RATE, gyroscope_unit=RateUnit.DEG_S)
    found = noise_of(recording)
    assert found.curve.n_samples == n
    assert found.axes[0].unit == "rad/s"
    assert found.axes[0].value("N") == pytest.approx(np.radians(1e-3), rel=0.02)
    assert "°/√h" in str(noise_report(found))
    assert curve_csv(found).startswith("tau_s,cluster,gyro_x_deviation[rad/s]")


def test_a_calibration_gives_a_log_in_counts_its_units_axis_by_axis(log):
    whole, per_count = trihedron.read(log), np.array([1e-4, 2e-4, 4e-4])
    counts = replace(whole, **{s: getattr(whole, s)[:20_000] for s in ("time_s", "accelerometer", "gyroscope")})
    readings = {"gyroscope": counts.gyroscope / per_count, "accelerometer": counts.accelerometer / 6e-4}
    raw = replace(counts, **readings, gyroscope_unit=RateUnit.COUNTS, accelerometer_unit=AccelerationUnit.COUNTS)
    known = given((6e-4 * np.eye(3), np.zeros(3)), (np.diag(per_count), np.zeros(3)), raw_unit="counts")
    plain, told = noise_of(counts), noise_of(raw, calibration=known)
    for one, other in zip(plain.axes, told.axes, strict=True):
        assert other.unit == one.unit
        assert other.terms["N"].value == pytest.approx(one.terms["N"].value, rel=1e-6)
