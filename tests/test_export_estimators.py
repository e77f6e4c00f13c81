"""What estimators and simulators make of the noise in their files, by their own sources, is that of the unit."""

import json
import re
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

import trihedron
from small_session import rejected
from test_export import NOISE, READINGS, ROUNDING, calibration, export_calibration
from trihedron.cli import main
from trihedron.files.calibration import write_calibration
from trihedron.files.formats import ExportOptions, NoiseFigure, SensorNoise, export_files

RATE, STEPS = 200.0, 1000
DT = 1.0 / RATE
SIM_RATE = 100.0
WHITE, WALK = {"accelerometer": 2e-3, "gyroscope": 1e-4}, {"accelerometer": 4e-4, "gyroscope": 2e-5}
OPTIONS = ExportOptions(
    *(SensorNoise(NoiseFigure(WHITE[s]), NoiseFigure(WALK[s])) for s in ("accelerometer", "gyroscope")),
    rate_hz=SIM_RATE,
)


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
    force, rate = [0, 0, 9.81] + 1e-2 * rng.standard_normal((20_000, 3)), 1e-3 * rng.standard_normal((20_000, 3))
    static = trihedron.Recording.from_arrays(np.arange(20_000) / 100.0, force, rate)
    trihedron.convert(static, tmp_path / "static.csv")
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
    assert "trihedron allan --json" in rejected(capsys, "export", file, "--to", "kalibr", "--noise", file)
    # Noise of a log that moves is written, and not to be trusted.
    moving = json.loads((tmp_path / "allan.json").read_text())
    words = {"seen": "It moves.", "cause": "", "action": "", "numbers": {}}
    moving["findings"].append({"code": "log-motion", "severity": "serious", **words})
    (tmp_path / "moving.json").write_text(json.dumps(moving))
    assert main(["export", str(file), "--to", "kalibr", "--noise", str(tmp_path / "moving.json")]) == 2
    assert "It moves." in capsys.readouterr().err


def gazebo(text):
    root = ElementTree.fromstring(text)
    dt = 1.0 / float(root.find("update_rate").text)
    for element in ("linear_acceleration", "angular_velocity"):
        axes = [{one.tag: float(one.text) for one in root.find(f"imu/{element}/{axis}/noise")} for axis in "xyz"]
        p = {tag: np.array([axis[tag] for axis in axes]) for tag in axes[0]}
        tau = p["dynamic_bias_correlation_time"]
        step = np.sqrt(-(p["dynamic_bias_stddev"] ** 2) * tau / 2 * np.expm1(-2 * dt / tau))
        yield p["stddev"], step, np.exp(-dt / tau), np.eye(3), p["mean"]


def gnss_ins_sim(text):
    scope: dict = {}
    exec(text, scope)
    e, root = scope["imu_err"], np.sqrt(scope["FS"])
    for sensor, white, unit in (
        ("accel", e["accel_vrw"], 1.0),
        ("gyro", np.radians(e["gyro_arw"]), np.radians(1) / 3600),
    ):
        b, drift, corr = (e[f"{sensor}_b{kind}"] for kind in ("", "_stability", "_corr"))
        yield white / 60 * root, unit * drift / root**2, 1 - 1 / root**2 / corr, np.eye(3), unit * b


def matlab(text, name):
    body = next(part for part in text.split("imu.") if part.startswith(name))
    found = dict(re.findall(r"'(\w+)', (\[[^\]]*\]|[\d.e+-]+)", body))
    return {key: np.array([float(v) for v in re.findall(r"[-+\d.e]+", value)]) for key, value in found.items()}


def imusensor(text):
    for attribute in ("Accelerometer", "Gyroscope"):
        p = matlab(text, attribute)
        white, step = p["NoiseDensity"] * np.sqrt(SIM_RATE), p["RandomWalk"] / np.sqrt(SIM_RATE)
        yield white, step, 1.0, p["AxesMisalignment"].reshape(3, 3) / 100.0, p["ConstantBias"]


def airsim(text):
    s, root = json.loads(text)["Sensors"]["Imu"], np.sqrt(SIM_RATE)
    accel = 9.80665e-3 * s["VelocityRandomWalk"], 9.80665e-6 * s["AccelBiasStability"], s["AccelBiasStabilityTau"]
    gyro = np.radians(s["AngularRandomWalk"]) / 60, np.radians(s["GyroBiasStability"]) / 3600, s["GyroBiasStabilityTau"]
    for white, stability, tau in (accel, gyro):
        yield white * root, stability / np.sqrt(tau) / root, 1.0, np.eye(3), np.zeros(3)


def mvsim(text):
    p = {one.tag: float(one.text) for one in ElementTree.fromstring(text)}
    for word in ("linear_acceleration", "angular_velocity"):
        step = p[f"{word}_random_walk_std_noise"] * np.sqrt(p["sensor_period"])
        yield p[f"{word}_white_noise_std_noise"], step, 1.0, np.eye(3), np.zeros(3)


def isaac(text):
    """Isaac Lab's gaussian_noise of operation "add", then the scale of the observation."""
    lines = [line for line in text.splitlines() if "import" not in line]
    scope = {"torch": SimpleNamespace(tensor=np.array), "GaussianNoiseCfg": SimpleNamespace}
    exec("\n".join(lines), scope)
    for term in (scope["IMU_LIN_ACC"], scope["IMU_ANG_VEL"]):
        noise, scale = term["noise"], np.array(term["scale"])
        yield noise.std * scale, 0.0, 1.0, np.diag(scale), noise.mean * scale


LAWS = {"gazebo": gazebo, "gnss-ins-sim": gnss_ins_sim, "imusensor": imusensor}
LAWS |= {"isaac": isaac, "airsim": airsim, "mvsim": mvsim}


@pytest.mark.parametrize("target", LAWS)
def test_the_simulators_own_law_gives_the_noise_of_the_unit(target):
    known = calibration("si")
    text = export_files(known, target, OPTIONS)[""]
    # Of each sensor: white noise of a sample, the step of the bias, the share of it that is kept, matrix and bias.
    for name, (white, step, keep, held, bias) in zip(WHITE, LAWS[target](text), strict=True):
        A = np.linalg.inv(getattr(known, name).S)
        without_walk, without_bias = target == "isaac", target in ("airsim", "mvsim")
        holds = {"imusensor": A, "isaac": np.diag(np.diag(A))}.get(target, np.eye(3))
        np.testing.assert_allclose(white, WHITE[name] * np.sqrt(SIM_RATE), rtol=1e-9)
        # A correlation time of 10⁶ s takes less than that of a step.
        np.testing.assert_allclose(step, 0.0 if without_walk else WALK[name] / np.sqrt(SIM_RATE), rtol=1e-6)
        assert np.all((1.0 - keep) * SIM_RATE < 1e-5)
        np.testing.assert_allclose(held, holds, **ROUNDING)
        np.testing.assert_allclose(bias, 0.0 if without_bias else -A @ getattr(known, name).b, **ROUNDING)
        assert (f"The walk of the {name}'s bias cannot be held" in text) == without_walk
        assert (f"bias of the {name} cannot be held" in text) == without_bias
        assert (f"misalignment of the {name} cannot be held" in text) == (target not in ("imusensor", "isaac"))
