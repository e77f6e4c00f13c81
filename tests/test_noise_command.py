"""The command ``allan`` end to end."""

import csv
import io
import json

import numpy as np
import pytest

from noise_series import series
from trihedron.cli import main
from trihedron.pipeline import noise as noise_of
from trihedron.records import Recording
from trihedron.report.noise import curve_csv, customary, noise_report
from trihedron.units import RateUnit

RATE = 50.0


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An hour of six axes at 50 Hz, with header."""
    rng = np.random.default_rng(31)
    n = 180_000
    gyro = [series(rng, n, RATE, N=2e-4, K=3e-6) for _ in range(3)]
    accel = [series(rng, n, RATE, N=2e-3, K=3e-5) + (9.81 if axis == 2 else 0.0) for axis in range(3)]
    path = tmp_path_factory.mktemp("noise") / "log.npz"
    names = ("gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")
    np.savez(path, t_s=np.arange(n) / RATE, **dict(zip(names, (*gyro, *accel), strict=True)))
    return path


def test_the_table_names_every_term_and_the_files_hold_the_same(log, tmp_path, capsys):
    files = {kind: tmp_path / f"x.{kind}" for kind in ("csv", "json", "png", "html")}
    wanted = ("--csv", "--json", "--plot", "--report")
    options = [word for option, file in zip(wanted, files.values(), strict=True) for word in (option, str(file))]
    status = main(["allan", str(log), "--full", *options])
    out, _ = capsys.readouterr()
    assert status == 0
    for words in ("angle random walk", "bias instability", "accelerometer_noise_density", "best averaging time"):
        assert words in out
    document = json.loads(files["json"].read_text())
    assert [axis["name"] for axis in document["axes"]][:2] == ["gyro x", "gyro y"]
    for axis in document["axes"]:
        truth = 2e-4 if axis["unit"] == "rad/s" else 2e-3
        assert axis["terms"]["N"]["value"] == pytest.approx(truth, rel=0.01)
        assert axis["terms"]["B"]["limit"] > 0.0
    rows = list(csv.reader(io.StringIO(files["csv"].read_text())))
    assert len(rows) == 1 + len(document["curve"]["tau_s"])
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    assert files["html"].read_text().count("data:image/png;base64,") == 2


def test_excluded_stretches_are_said_and_left_out(log, capsys):
    assert main(["allan", str(log), "--exclude", "100:200", "--exclude", "150:300", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["excluded_s"] == [[100.0, 300.0]]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--exclude", "later"], "FROM:TO"),
        (["--exclude", "200:100"], "earlier to a later"),
        (["--exclude", "9e6:9e7"], "outside the log"),
    ],
)
def test_a_wrong_stretch_is_refused_in_one_sentence(log, capsys, arguments, words):
    assert main(["allan", str(log), *arguments]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert words in err


def test_lost_rows_become_missing_readings_not_shorter_time():
    rng = np.random.default_rng(32)
    n = 60_000
    kept = np.ones(n, dtype=bool)
    kept[20_000:26_000] = False
    gyro = np.column_stack([series(rng, n, RATE, N=1e-3, K=1e-4) for _ in range(3)])
    recording = Recording(np.arange(n)[kept] / RATE, None, gyro[kept], RATE, gyroscope_unit=RateUnit.DEG_S)
    found = noise_of(recording)
    assert found.curve.n_samples == n
    assert found.axes[0].unit == "rad/s"
    assert found.axes[0].value("N") == pytest.approx(np.radians(1e-3), rel=0.02)
    assert "°/√h" in str(noise_report(found))
    assert curve_csv(found).startswith("tau_s,cluster,gyro_x_deviation[rad/s]")


def test_customary_units_are_those_of_the_field():
    # 0.1 °/√h is 2.909e-5 rad/s/√Hz; 100 µg/√Hz-class constants likewise by hand.
    name, unit, factor = customary("N", "rad/s")
    assert (name, unit) == ("angle random walk", "°/√h")
    assert factor * 2.9088821e-5 == pytest.approx(0.1, rel=1e-7)
    assert customary("B", "rad/s")[2] * np.radians(1.0) / 3600 == pytest.approx(1.0)
    assert customary("B", "m/s^2")[2] * 9.80665e-6 == pytest.approx(1.0)
    assert customary("N", "counts") is None
