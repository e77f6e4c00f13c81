"""What estimators and simulators make of the noise in their files, by their own sources, is that of the unit."""

import json
import re
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from scipy.signal import lfilter

import trihedron
from small_session import rejected
from test_export import NOISE, READINGS, ROUNDING, calibration, export_calibration
from trihedron.cli import main
from trihedron.files.calibration import write_calibration
from trihedron.files.formats import ExportOptions, NoiseFigure, SensorNoise, export_files

RATE, STEPS = 200.0, 1000
DT = 1.0 / RATE
SIM_RATE, SECONDS, G = 100.0, 1000, 9.81
WHITE, WALK = {"accelerometer": 2e-3, "gyroscope": 1e-4}, {"accelerometer": 4e-4, "gyroscope": 2e-5}
OPTIONS = ExportOptions(
    *(SensorNoise(NoiseFigure(WHITE[s]), NoiseFigure(WALK[s])) for s in ("accelerometer", "gyroscope")),
    rate_hz=SIM_RATE,
)
N = int(SIM_RATE * SECONDS)
TRUTH = {"accelerometer": np.tile([0.0, 0.0, G], (N, 1)), "gyroscope": np.zeros((N, 3))}


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


def walk(rng, n, step, keep=1.0):
    """(n, 3): b[k] = keep b[k-1] + N(0, step²), from zero."""
    return lfilter([1.0], [1.0, -keep], step * rng.standard_normal((n, 3)), axis=0)


def gazebo(text, rng, truth):
    root = ElementTree.fromstring(text)
    dt = 1.0 / float(root.find("update_rate").text)
    out = {}
    for element, name in (("angular_velocity", "gyroscope"), ("linear_acceleration", "accelerometer")):
        columns = []
        for axis in "xyz":
            p = {one.tag: float(one.text) for one in root.find(f"imu/{element}/{axis}/noise")}
            tau, sigma = p["dynamic_bias_correlation_time"], p["dynamic_bias_stddev"]
            step = np.sqrt(-(sigma**2) * tau / 2 * np.expm1(-2 * dt / tau))
            slow = walk(rng, len(truth[name]), step, np.exp(-dt / tau))[:, 0]
            columns.append(slow + rng.normal(p["mean"], p["stddev"], len(slow)))
        out[name] = truth[name] + np.array(columns).T
    return out


def gnss_ins_sim(text, rng, truth):
    scope: dict = {}
    exec(text, scope)
    e, dt = scope["imu_err"], 1.0 / scope["FS"]
    hour = np.radians(1) / 3600
    sizes = {
        "gyroscope": (e["gyro_b"] * hour, e["gyro_b_stability"] * hour, np.radians(e["gyro_arw"]) / 60, "gyro_b_corr"),
        "accelerometer": (e["accel_b"], e["accel_b_stability"], e["accel_vrw"] / 60, "accel_b_corr"),
    }
    out = {}
    for name, (b, drift, white, corr) in sizes.items():
        slow = walk(rng, len(truth[name]), dt * drift, 1 - dt / e[corr][0])
        out[name] = truth[name] + b + slow + white / np.sqrt(dt) * rng.standard_normal(truth[name].shape)
    return out


def matlab(text, name):
    body = next(part for part in text.split("imu.") if part.startswith(name))
    found = dict(re.findall(r"'(\w+)', (\[[^\]]*\]|[\d.e+-]+)", body))
    return {key: np.array([float(v) for v in re.findall(r"[-+\d.e]+", value)]) for key, value in found.items()}


def imusensor(text, rng, truth):
    out = {}
    for attribute, name in (("Accelerometer", "accelerometer"), ("Gyroscope", "gyroscope")):
        p = matlab(text, attribute)
        A = p["AxesMisalignment"].reshape(3, 3) / 100.0
        white = p["NoiseDensity"] * np.sqrt(SIM_RATE) * rng.standard_normal(truth[name].shape)
        slow = walk(rng, len(truth[name]), p["RandomWalk"] / np.sqrt(SIM_RATE))
        out[name] = truth[name] @ A.T + p["ConstantBias"] + white + slow
    return out


def airsim(text, rng, truth):
    s, dt = json.loads(text)["Sensors"]["Imu"], 1.0 / SIM_RATE
    gyro = np.radians(s["AngularRandomWalk"]) / 60, np.radians(s["GyroBiasStability"]) / 3600, s["GyroBiasStabilityTau"]
    accel = 9.80665e-3 * s["VelocityRandomWalk"], 9.80665e-6 * s["AccelBiasStability"], s["AccelBiasStabilityTau"]
    out = {}
    for name, (white, stability, tau) in (("gyroscope", gyro), ("accelerometer", accel)):
        slow = walk(rng, len(truth[name]), stability / np.sqrt(tau) * np.sqrt(dt))
        out[name] = truth[name] + white / np.sqrt(dt) * rng.standard_normal(truth[name].shape) + slow
    return out


def mvsim(text, rng, truth):
    p = {one.tag: float(one.text) for one in ElementTree.fromstring(text)}
    dt = p["sensor_period"]
    words = {"gyroscope": "angular_velocity", "accelerometer": "linear_acceleration"}
    return {
        name: truth[name]
        + walk(rng, len(truth[name]), p[f"{word}_random_walk_std_noise"] * np.sqrt(dt))
        + p[f"{word}_white_noise_std_noise"] * rng.standard_normal(truth[name].shape)
        for name, word in words.items()
    }


def isaac(text, rng, truth):
    """Isaac Lab's gaussian_noise of operation "add", then the scale of the observation."""
    lines = [line for line in text.splitlines() if "import" not in line]
    scope = {"torch": SimpleNamespace(tensor=np.array), "GaussianNoiseCfg": SimpleNamespace}
    exec("\n".join(lines), scope)
    out = {}
    for name, term in (("gyroscope", scope["IMU_ANG_VEL"]), ("accelerometer", scope["IMU_LIN_ACC"])):
        noise = term["noise"]
        readings = truth[name] + noise.mean + noise.std * rng.standard_normal(truth[name].shape)
        out[name] = readings * np.array(term["scale"])
    return out


LAWS = {"gazebo": gazebo, "gnss-ins-sim": gnss_ins_sim, "imusensor": imusensor}
LAWS |= {"isaac": isaac, "airsim": airsim, "mvsim": mvsim}


@pytest.mark.parametrize("target", LAWS)
def test_the_simulators_own_law_gives_the_noise_of_the_unit(target):
    known = calibration("si")
    text = export_files(known, target, OPTIONS)[""]
    made = LAWS[target](text, np.random.default_rng(7), TRUTH)
    log = {"t": np.arange(N) / SIM_RATE, "acc": made["accelerometer"], "gyr": made["gyroscope"]}
    noise = trihedron.allan(trihedron.read(log, accelerometer_unit="m/s^2", gyroscope_unit="rad/s"))
    for axis in noise.axes:
        name = "accelerometer" if axis.unit == "m/s^2" else "gyroscope"
        terms = axis.terms
        # 100 000 samples know N to 0.3 %, 1000 s know K to 15 to 25 %.
        assert terms["N"].value == pytest.approx(WHITE[name], rel=0.02), (target, axis)
        if target == "isaac":
            assert f"The walk of the {name}'s bias cannot be held" in text
        else:
            assert terms["K"].value == pytest.approx(WALK[name], rel=0.5), (target, axis)
    for name in TRUTH:
        A = np.linalg.inv(getattr(known, name).S)
        b = -A @ getattr(known, name).b
        reading = made[name][: int(SIM_RATE)].mean(axis=0) - TRUTH[name][0]
        if target in ("imusensor", "isaac"):
            held = A if target == "imusensor" else np.diag(np.diag(A))
            wanted = held @ TRUTH[name][0] + b - TRUTH[name][0]
        elif target in ("airsim", "mvsim"):
            assert f"bias of the {name} cannot be held" in text
            wanted = np.zeros(3)
        else:
            wanted = b
            assert f"misalignment of the {name} cannot be held" in text
        # One second of white noise, and a second of walk.
        tolerance = 6 * np.hypot(WHITE[name], WALK[name])
        np.testing.assert_allclose(reading, wanted, atol=tolerance)
