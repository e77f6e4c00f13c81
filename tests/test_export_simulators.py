"""A simulator's own noise law, run on the exported file, gives the unit's noise and bias, or the file names the loss.

The laws are written here from the simulators' published sources and documentation: gz-sensors (slow bias as in RotorS),
gnss-ins-sim (pathgen), MathWorks' page of imuSensor, AirSim (ImuSimple), mvsim (Forster's model).
"""

import json
import re
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.signal import lfilter

import trihedron
from test_export import calibration
from trihedron.files.formats import ExportOptions, NoiseFigure, SensorNoise, export_files

RATE, SECONDS, G = 100.0, 1000, 9.81
WHITE, WALK = {"accelerometer": 2e-3, "gyroscope": 1e-4}, {"accelerometer": 4e-4, "gyroscope": 2e-5}
OPTIONS = ExportOptions(
    *(SensorNoise(NoiseFigure(WHITE[s]), NoiseFigure(WALK[s])) for s in ("accelerometer", "gyroscope")), rate_hz=RATE
)
N = int(RATE * SECONDS)
TRUTH = {"accelerometer": np.tile([0.0, 0.0, G], (N, 1)), "gyroscope": np.zeros((N, 3))}


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
        white = p["NoiseDensity"] * np.sqrt(RATE) * rng.standard_normal(truth[name].shape)
        out[name] = (
            truth[name] @ A.T + p["ConstantBias"] + white + walk(rng, len(truth[name]), p["RandomWalk"] / np.sqrt(RATE))
        )
    return out


def airsim(text, rng, truth):
    s, dt = json.loads(text)["Sensors"]["Imu"], 1.0 / RATE
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


LAWS = {
    "gazebo": gazebo, "gnss-ins-sim": gnss_ins_sim, "imusensor": imusensor, "isaac": isaac, "airsim": airsim,
    "mvsim": mvsim,
}  # fmt: skip


@pytest.mark.parametrize("target", LAWS)
def test_the_simulators_own_law_gives_the_noise_of_the_unit(target):
    known = calibration("si")
    text = export_files(known, target, OPTIONS)[""]
    made = LAWS[target](text, np.random.default_rng(7), TRUTH)
    log = {"t": np.arange(N) / RATE, "acc": made["accelerometer"], "gyr": made["gyroscope"]}
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
    biases = {s: -np.linalg.solve(getattr(known, s).S, getattr(known, s).b) for s in TRUTH}
    for name, b in biases.items():
        A = np.linalg.inv(getattr(known, name).S)
        reading = made[name][: int(RATE)].mean(axis=0) - TRUTH[name][0]
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
