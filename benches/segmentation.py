"""Figures of docs/segmentation.md: coverage of the error bars of means, and gyro scale against duration of moves."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from test_segment import made_session, one_over_f, random_walk, scenario, white
from trihedron.segment import segment_recording
from trihedron.simulate import Hold, Motion, Turn, simulate


def coverage(noise_of):
    single, pairs = [], []
    for seed in range(25):
        recording, truth, _ = made_session(seed, noise_of)
        segments = segment_recording(recording)
        if segments.n_holds != len(truth):
            continue
        error = np.hstack([segments.accelerometer_mean, segments.gyroscope_mean]) - truth
        sigma = np.hstack([segments.accelerometer_sigma_mean, segments.gyroscope_sigma_mean])
        single.append((error / sigma).ravel())
        pairs.append((np.diff(error, axis=0) / np.hypot(sigma[1:], sigma[:-1])).ravel())
    z, d = np.concatenate(single), np.concatenate(pairs)
    return z.std(), np.mean(np.abs(z) < 1.0), np.mean(np.abs(z) < 1.96), d.std(), len(single)


def scale_error(duration_s, grade):
    steps = [Hold(10.0)]
    for k in range(8):
        steps += [Turn((0.0, 0.0, 1.0), 90.0 * (-1) ** k, duration_s, ramp=0.5), Hold(4.0)]
    errors = []
    for seed in range(4):
        recording, truth = simulate(scenario(Motion(tuple(steps)), grade), seed)
        segments = segment_recording(recording)
        angle = 0.0
        for k, move in enumerate(segments.moves):
            rate = recording.gyroscope[move.start : move.stop]
            into = np.linspace(0.0, 1.0, len(rate))[:, None]
            bias = segments.gyroscope_mean[k] * (1.0 - into) + segments.gyroscope_mean[k + 1] * into
            angle += (-1) ** k * (truth.gyroscope_S @ (rate - bias).sum(axis=0))[2] / recording.rate_hz
        errors.append(angle / (4.0 * np.pi) - 1.0)
    return np.mean(errors), np.std(errors, ddof=1) / np.sqrt(len(errors))


if __name__ == "__main__":
    print("| noise | rms z of means | within 1 σ | within 1.96 σ | rms z of neighbours' differences | sessions |")
    print("|---|---|---|---|---|---|")
    for name, noise_of in (("white", white), ("1/f", one_over_f), ("random walk", random_walk)):
        rms, one, two, pair, n = coverage(noise_of)
        print(f"| {name} | {rms:.2f} | {one:.3f} | {two:.3f} | {pair:.2f} | {n} |")
    print("\n| noise | quarter turn takes | error of gyro scale |\n|---|---|---|")
    for grade in (1.0, 10.0):
        for duration_s in (1.5, 4.0, 10.0, 30.0):
            mean, error = scale_error(duration_s, grade)
            print(f"| data sheet x {grade:g} | {duration_s:g} s | {mean:+.1e} ± {error:.0e} |")
