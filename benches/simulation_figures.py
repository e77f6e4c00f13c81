"""Pictures of docs/simulation.md: `python benches/simulation_figures.py [FOLDER OF REAL RECORDINGS]`."""

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullFormatter

from trihedron.estimate.noise.allan import allan_deviation
from trihedron.pipeline import calibrate, read, segment
from trihedron.simulate import NoiseTerms, make_noise, scenario_by_name, simulate, twin_scenario

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
COLOURS = ("#3b6ea5", "#c05a2b", "#4d8f5b")


def save(figure, name, dpi=70):
    figure.savefig(FIGURES / f"simulation_{name}.png", dpi=dpi)
    plt.close(figure)


def manual_signals():
    """The laboratory manual's example: 18 poses, then ±8π on three faces."""
    recording, truth = simulate(scenario_by_name("manual-example"), seed=1)
    first_turn = next(s for s in truth.segments if s.kind == "turn")
    split = first_turn.start_s - 8.0
    for name, readings, window, title in (
        ("manual_poses", recording.accelerometer, (0.0, split), "Accelerometer, 18 poses"),
        ("manual_turns", recording.gyroscope, (split, recording.time_s[-1]), "Gyro, turns by ±8π on three faces"),
    ):
        figure, axis = plt.subplots(figsize=(9, 3.4), layout="constrained")
        chosen = (recording.time_s >= window[0]) & (recording.time_s <= window[1])
        for k, colour in enumerate(COLOURS):
            axis.plot(recording.time_s[chosen], readings[chosen, k], color=colour, lw=0.8, label=f"axis {k + 1}")
        axis.set(xlabel="time [s]", ylabel="counts", title=f"{title} (simulated, 10-bit converter, 50 Hz)")
        axis.legend(loc="upper right", ncols=3, fontsize=8)
        axis.margins(x=0.01)
        save(figure, name)


def allan_curves():
    """A simulated sum of terms, and both sensors of the manual's unit at rest."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    rate, n = 50.0, 360_000
    terms = NoiseTerms(Q=(1e-3, 0, 0), N=(5e-3, 0, 0), B=(1.5e-3, 0, 0), K=(1e-4, 0, 0))
    x = make_noise(terms, n, 1.0 / rate, 3, "sum")[:, 0]
    curve = allan_deviation(x, rate)
    tau = curve.tau_s
    axes[0].loglog(tau, curve.deviation, color=COLOURS[0], label="simulated sum")
    axes[0].fill_between(tau, curve.lower, curve.upper, color=COLOURS[0], alpha=0.2, label="95 %")
    q, w, b, k = terms.Q[0], terms.N[0], terms.B[0], terms.K[0]
    parts = [3 * q**2 / tau**2, w**2 / tau, np.full_like(tau, 2 * np.log(2) / np.pi * b**2), k**2 * tau / 3]
    axes[0].loglog(tau, np.sqrt(sum(parts)), "k--", lw=1, label="from Q, N, B, K")
    for part in parts:
        axes[0].loglog(tau, np.sqrt(part), "k:", lw=0.6)
    axes[0].set(title="Sum of four terms", ylabel="Allan deviation [unit]", ylim=(3e-4, 1e-1))
    recording, truth = simulate(scenario_by_name("rest-manual"), seed=1)
    for axis, readings, S, title, unit in (
        (axes[1], recording.gyroscope, truth.gyroscope_S, "Gyro at rest", "rad/s"),
        (axes[2], recording.accelerometer, truth.accelerometer_S, "Accelerometer at rest", "m/s²"),
    ):
        curve = allan_deviation(readings @ S.T, recording.rate_hz)
        for j, colour in enumerate(COLOURS):
            axis.loglog(curve.tau_s, curve.deviation[:, j], color=colour, label=f"axis {j + 1}")
        axis.set(title=f"{title}, 2 h simulated", ylabel=f"Allan deviation [{unit}]")
    for axis in axes:
        axis.set_xlabel("averaging time [s]")
        axis.grid(True, which="both", lw=0.2)
        axis.legend(fontsize=8)
    save(figure, "allan")


def spectrum(readings, holds, window=128):
    total, count = 0.0, 0
    for hold in holds:
        for k in range(hold.start, hold.stop - window, window // 2):
            block = readings[k : k + window]
            total += np.abs(np.fft.rfft((block - block.mean(axis=0)) * np.hanning(window)[:, None], axis=0)) ** 2
            count += 1
    return total / count


def report(name, recording, copy, segments, calibration):
    """The numbers of docs/simulation.md, section 7."""
    S = calibration.gyroscope.S
    moving = np.concatenate([np.arange(move.start, move.stop) for move in segments.moves])
    rate = (recording.gyroscope @ S.T + calibration.gyroscope.b)[moving]
    apart = ((recording.gyroscope - copy.gyroscope) @ S.T)[moving]
    ratio = np.sqrt(np.mean(apart**2, axis=0) / np.mean(rate**2, axis=0))
    print(f"{name}: rate in moves, rms difference / rms rate {ratio.min():.2%} to {ratio.max():.2%}")
    for sensor in ("accelerometer", "gyroscope"):
        spectra = spectrum(getattr(copy, sensor), segments.holds) / spectrum(getattr(recording, sensor), segments.holds)
        octaves = [np.exp(np.log(spectra[a:b]).mean(axis=0)) for a, b in ((2, 4), (4, 8), (8, 16), (16, 32), (32, 65))]
        print(f"{name}: {sensor} noise, twin / recording by octave {np.min(octaves):.2f} to {np.max(octaves):.2f}")


def twins(data):
    """Spectra inside the holds and one move, of two recordings and their twins."""
    cases = (
        (
            "xsens_mti",
            read(accelerometer_path=data / "xsens_mti/xsens_acc.txt", gyroscope_path=data / "xsens_mti/xsens_gyro.txt"),
            9.81744,
        ),
        ("mpu9150, unit 0", read(data / "mpu9150/imu0.log", rate_hz=100), 9.81),
    )
    figure, axes = plt.subplots(2, 3, figsize=(12, 6.4), layout="constrained")
    for row, (name, recording, gravity) in zip(axes, cases, strict=True):
        segments = segment(recording)
        calibration = calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration
        copy, _ = simulate(twin_scenario(recording, segments, calibration), seed=1)
        for axis, sensor, unit in ((row[0], "accelerometer", "m/s²"), (row[1], "gyroscope", "rad/s")):
            S = getattr(calibration, sensor).S
            f = np.fft.rfftfreq(128, 1.0 / recording.rate_hz)[2:]
            scale = np.abs(np.diag(S)) ** 2 * 2.0 / (recording.rate_hz * np.sum(np.hanning(128) ** 2))
            for label, source, style in (("recording", recording, "-"), ("twin", copy, "--")):
                psd = spectrum(getattr(source, sensor), segments.holds)[2:] * scale
                for k, colour in enumerate(COLOURS):
                    axis.loglog(f, np.sqrt(psd[:, k]), style, color=colour, lw=1, label=label if k == 0 else None)
            axis.xaxis.set_minor_formatter(NullFormatter())
            axis.set(title=f"{name}: {sensor} in the holds", xlabel="frequency [Hz]", ylabel=f"density [({unit})/√Hz]")
            axis.legend(fontsize=8)
        report(name, recording, copy, segments, calibration)
        move = segments.moves[3]
        a, b = max(move.start - 100, 0), move.stop + 100
        w = [(s.gyroscope @ calibration.gyroscope.S.T + calibration.gyroscope.b)[a:b] for s in (recording, copy)]
        for k, colour in enumerate(COLOURS):
            row[2].plot(recording.time_s[a:b], w[0][:, k], color=colour, lw=2.2, alpha=0.45)
            row[2].plot(recording.time_s[a:b], w[1][:, k], color=colour, lw=0.8)
        row[2].set(title=f"{name}: a move", xlabel="time [s]", ylabel="rate [rad/s]")
    save(figure, "twins", dpi=62)


def stages():
    """What three mechanisms do to the error of a session."""
    base = scenario_by_name("linear-noiseless")
    from trihedron.simulate import with_effect

    cases = (
        ("proof mass in its gap: K2 = 3e-4, K3 = 1e-5", "accel-quadratic", {"k2": 3e-4}, "accel-cubic", {"k3": 1e-5}),
        (
            "hysteresis 0.02 m/s², creep 0.2 % in 20 s",
            "accel-hysteresis",
            {"offset_m_s2": 0.02, "creep_fraction": 2e-3},
        ),
        ("die 12 K warmer in 2 min, 4 (mm/s²)/K", "accel-thermal-bias", {"per_k": 0.004, "logged": False}),
    )
    figure, axes = plt.subplots(3, 1, figsize=(9, 6), layout="constrained", sharex=True)
    for axis, (title, *pairs) in zip(axes, cases, strict=True):
        scenario = base
        for effect, size in zip(pairs[::2], pairs[1::2], strict=True):
            scenario = with_effect(scenario, effect, **size)
        recording, truth = simulate(replace(scenario), seed=0)
        error = recording.accelerometer @ truth.accelerometer_S.T + truth.accelerometer_b - truth.specific_force_m_s2
        for k, colour in enumerate(COLOURS):
            axis.plot(recording.time_s, 1e3 * error[:, k], color=colour, lw=0.8)
        axis.set(title=title, ylabel="error [mm/s²]")
    axes[-1].set_xlabel("time [s]")
    axes[0].margins(x=0.01)
    save(figure, "stages")


if __name__ == "__main__":
    FIGURES.mkdir(parents=True, exist_ok=True)
    manual_signals()
    allan_curves()
    stages()
    if len(sys.argv) > 1:
        twins(Path(sys.argv[1]))
