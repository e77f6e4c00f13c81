"""What estimators make of the noise in their files, by their own sources, is N² a second of angle and K² of bias."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from test_export import NOISE, READINGS, ROUNDING, calibration, export_calibration
from trihedron.cli import main
from trihedron.files.calibration import write_calibration

RATE, STEPS = 200.0, 1000
DT = 1.0 / RATE


def orb_slam3(text):
    """Settings.cc reads reals with a point; ImuTypes.cc has (N √f)² a sample, times dt², and (K/√f)² of the walk."""
    lines = dict(line.split(": ") for line in text.splitlines() if ": " in line and line[0] != "#")
    assert all("." in lines[key] for key in lines if key.startswith("IMU."))
    p = {key: float(value) for key, value in lines.items()}
    root = np.sqrt(p["IMU.Frequency"])
    for sensor in ("Acc", "Gyro"):
        yield (p[f"IMU.Noise{sensor}"] * root) ** 2 * DT**2, (p[f"IMU.{sensor}Walk"] / root) ** 2


def lio_sam(text):
    """imuPreintegration.cpp squares the densities for GTSAM (times dt), and the biases' √(span) of them."""
    p = yaml.safe_load(text)
    for sensor in ("Acc", "Gyr"):
        yield p[f"imu{sensor}Noise"] ** 2 * DT, (np.sqrt(DT) * p[f"imu{sensor}BiasN"]) ** 2


def fast_lio(text):
    """Its filter adds (dt F) Q (dt F)ᵀ a sample, Q the covariances of the file as they stand."""
    p = yaml.safe_load(text)["mapping"]
    for sensor in ("acc", "gyr"):
        yield p[f"{sensor}_cov"] * DT**2, p[f"b_{sensor}_cov"] * DT**2


class Params(SimpleNamespace):
    """GTSAM's PreintegrationCombinedParams: covariances of continuous noise, which its integration multiplies by dt."""

    @classmethod
    def MakeSharedU(cls, g):
        return cls(g=g)

    def __getattr__(self, name):
        return lambda value: setattr(self, name[3:], value)


def gtsam_module(text):
    scope: dict = {}
    exec(text.replace("import gtsam", ""), scope)
    scope["gtsam"] = SimpleNamespace(PreintegrationCombinedParams=Params)
    return scope


def gtsam(text):
    p = gtsam_module(text)["preintegration_params"]()
    for sensor, bias in (("Accelerometer", "Acc"), ("Gyroscope", "Omega")):
        covariances = getattr(p, f"{sensor}Covariance"), getattr(p, f"Bias{bias}Covariance")
        yield tuple(float(c[0, 0]) * DT for c in covariances)


CONSUMERS = {"orb-slam3": orb_slam3, "lio-sam": lio_sam, "fast-lio": fast_lio, "gtsam": gtsam}


@pytest.mark.parametrize("target", CONSUMERS)
def test_an_estimator_lets_angle_and_bias_spread_as_the_noise_does(target):
    text = export_calibration(calibration("si"), target, NOISE)
    wanted = [(n.N.value, n.K.value) for n in (NOISE.accelerometer_noise, NOISE.gyroscope_noise)]
    for (N, K), (white, walk) in zip(wanted, CONSUMERS[target](text), strict=True):
        seconds = STEPS * DT
        assert white * STEPS == pytest.approx(N**2 * seconds, rel=1e-12)
        assert walk * STEPS == pytest.approx(K**2 * seconds, rel=1e-12)


def test_gtsam_is_given_what_apply_gives():
    known = calibration("si")
    scope = gtsam_module(export_calibration(known, "gtsam", NOISE))
    for name, sensor in (("ACCELEROMETER", known.accelerometer), ("GYROSCOPE", known.gyroscope)):
        made = READINGS @ scope[f"S_{name}"].T + scope[f"B_{name}"]
        np.testing.assert_allclose(made, READINGS @ sensor.S.T + sensor.b, **ROUNDING)


def test_imu_calib_corrects_the_accelerometer_as_apply_does():
    """accel_calib.cpp: corrected = SM raw - bias."""
    known = calibration("si")
    p = yaml.safe_load(export_calibration(known, "imu_calib"))
    made = READINGS @ np.reshape(p["SM"], (3, 3)).T - p["bias"]
    np.testing.assert_allclose(made, READINGS @ known.accelerometer.S.T + known.accelerometer.b, **ROUNDING)


def test_noise_of_a_rest_log_goes_from_allan_into_the_export(tmp_path, capsys):
    rng = np.random.default_rng(3)
    t = np.arange(20_000) / 100.0
    table = np.column_stack([t, [0, 0, 9.81, 0, 0, 0] + np.repeat([1e-2, 1e-3], 3) * rng.standard_normal((len(t), 6))])
    head = "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]"
    np.savetxt(tmp_path / "static.csv", table, delimiter=",", header=head, comments="", fmt="%.9g")
    assert main(["allan", str(tmp_path / "static.csv"), "--json", str(tmp_path / "allan.json")]) == 0
    file = tmp_path / "c.json"
    write_calibration(calibration("si"), file)
    capsys.readouterr()
    assert main(["export", str(file), "--to", "kalibr", "--noise", str(tmp_path / "allan.json")]) == 0
    document = yaml.safe_load(capsys.readouterr().out)
    # White noise of 1e-2 at 100 Hz is 1e-3 per √Hz; 20 000 samples know it to 0.5 %.
    assert document["accelerometer_noise_density"] == pytest.approx(1e-3, rel=0.02)
    assert document["gyroscope_noise_density"] == pytest.approx(1e-4, rel=0.02)
    assert document["update_rate"] == pytest.approx(100.0, rel=1e-3)
    assert main(["export", str(file), "--to", "kalibr", "--noise", str(file)]) == 1
    assert "trihedron allan --json" in capsys.readouterr().err
    # Noise of a log that moves is written, and not to be trusted.
    moving = json.loads((tmp_path / "allan.json").read_text())
    words = {"seen": "It moves.", "cause": "", "action": "", "numbers": {}}
    moving["findings"].append({"code": "log-motion", "severity": "serious", **words})
    (tmp_path / "moving.json").write_text(json.dumps(moving))
    assert main(["export", str(file), "--to", "kalibr", "--noise", str(tmp_path / "moving.json")]) == 2
    assert "It moves." in capsys.readouterr().err
