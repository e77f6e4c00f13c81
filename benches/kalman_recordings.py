"""Filter against batch fit on recordings: `PYTHONPATH=python python benches/kalman_recordings.py FOLDER`.

FOLDER holds the real recordings (`xsens_mti`, `ctu`). The norm-invariant filter runs with the white noise measured in
the holds, the batch fit with the same standard errors; largest difference of a constant in its standard errors. Then
with the slow noise a batch fit of independent poses cannot know.
"""

import sys
from pathlib import Path

import numpy as np

import trihedron
from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.kalman import calibrate_without_references
from trihedron.records import AxisNoise
from trihedron.segment import segment_recording


def compare(name, means, sigma, start, hold, gravity, unit):
    batch, findings = calibrate_norm(means, sigma, gravity, raw_unit=unit)
    # All of the noise per pose as extra variance; what little white noise the model must have is a thousandth of it.
    tiny = [AxisNoise(white=1e-3 * np.median(sigma[:, i]) * np.sqrt(np.median(hold))) for i in range(3)]
    run = {"start_s": start, "hold_s": hold, "gravity_m_s2": gravity, "extra_variance": sigma**2, "raw_unit": unit}
    result = calibrate_without_references(means, tiny, **run)
    got, want = result.accelerometer, batch
    scale = np.concatenate([want.sigma_S.ravel(), want.sigma_b])
    difference = np.concatenate([(got.S - want.S).ravel(), got.b - want.b])
    free = scale > 0
    stated = np.concatenate([got.sigma_S.ravel(), got.sigma_b])[free] / scale[free]
    print(f"## {name}: {len(means)} poses")
    largest, seen = np.max(np.abs(difference[free] / scale[free])), result.consistency
    rms = 1e3 * np.sqrt(np.mean(result.residual_m_s2**2))
    print(f"largest difference {largest:.2e} standard errors; {result.n_runs} runs")
    print(f"standard errors {stated.min():.4f} to {stated.max():.4f} of the batch fit's")
    print(f"residual rms {rms:.3f} mm/s², NIS {seen.nis_mean:.2f} (99 % {seen.nis_low:.2f} to {seen.nis_high:.2f})")
    print(f"whiteness p {seen.whiteness_p:.3f}")
    for finding in (*findings, *result.findings):
        print(f"  {finding.code.value}: {finding.seen}")
    return result


def main(folder):
    xsens = folder / "xsens_mti"
    recording = trihedron.read(accelerometer_path=xsens / "xsens_acc.txt", gyroscope_path=xsens / "xsens_gyro.txt")
    segments = segment_recording(recording)
    sigma = segments.accelerometer_sigma_mean
    start = np.array([recording.time_s[h.start] for h in segments.holds])
    hold = np.array([recording.time_s[h.stop - 1] for h in segments.holds]) - start + 1.0 / recording.rate_hz
    result = compare("xsens_mti", segments.accelerometer_mean, sigma, start, hold, 9.81744, "counts")
    slow = np.sqrt(max(result.consistency.nis_mean, 1.0))
    print(f"the stated noise must grow by {slow:.2f} to explain the poses")
    means = np.loadtxt(folder / "ctu" / "measured_accelerations.csv", delimiter=",", skiprows=1)
    # Nothing is known of the noise: the same for all poses and axes, of the size that explains the residuals.
    sigma = np.full(means.shape, 2e-3)
    for _ in range(3):
        sensor, _ = calibrate_norm(means, sigma, 9.81, raw_unit="g")
        residual = np.linalg.norm(means @ sensor.S.T + sensor.b, axis=1) - 9.81
        sigma = np.full(means.shape, np.sqrt(np.sum(residual**2) / (len(means) - 9)) / 9.80665)
    compare("ctu", means, sigma, 10.0 * np.arange(len(means)), np.full(len(means), 5.0), 9.81, "g")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
