"""The picture of README, what the tool does from a log to a verdict: ``python benches/readme_picture.py``.

Four panels, all of simulated sensors: a session with its still poses; what every pose misses gravity by, with the data
sheet's one scale and with the calibration; an Allan curve with its white noise; and a diagnosis of a sensor with five
effects at once, what each domain misses before and after they were found.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import trihedron
from trihedron.files.output import write_whole
from trihedron.report.figures import png
from trihedron.simulate import scenario_by_name, simulate

OUTPUT = Path(__file__).parents[1] / "docs" / "figures" / "overview.png"
BLUE, ORANGE, GREY = "#3b6fb6", "#d9822b", "#888888"


def draw() -> Figure:
    """All panels."""
    scenario = scenario_by_name("hand-session")
    recording, truth = simulate(scenario, seed=3)
    result = trihedron.calibrate(recording, gravity_m_s2=truth.gravity_m_s2)
    figure = Figure(figsize=(11.0, 6.2), dpi=110, layout="constrained")
    axes = figure.subplots(2, 2)
    _signals(axes[0, 0], recording, result.segments)
    _poses(axes[0, 1], result, truth.gravity_m_s2)
    _noise(axes[1, 0])
    _verdict(axes[1, 1])
    for panel in axes.flat:
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=8)
    return figure


def _signals(panel, recording, segments):
    chosen = recording.time_s < 60.0
    counts = recording.accelerometer[chosen] / 1000.0
    for axis, colour in zip(range(3), (BLUE, ORANGE, "#4a9d5b"), strict=True):
        panel.plot(recording.time_s[chosen], counts[:, axis], color=colour, lw=0.7)
    for hold in segments.holds:
        start, stop = recording.time_s[hold.start], recording.time_s[hold.stop - 1]
        if start < 60.0:
            panel.axvspan(start, min(stop, 60.0), color="#dfe7f3", lw=0)
    panel.set(xlabel="time, s", ylabel="accelerometer, 1000 counts", xlim=(0, 60))
    panel.set_title("1  A raw log; still poses are found", loc="left", fontsize=10)


def _poses(panel, result, gravity):
    means = result.segments.accelerometer_mean
    ratio = gravity / np.median(np.linalg.norm(means, axis=1))
    before = 1e3 * (np.linalg.norm(ratio * means, axis=1) - gravity)
    fit = result.accelerometer
    after = 1e3 * (np.linalg.norm(means @ fit.S.T + fit.b, axis=1) - gravity)
    number = np.arange(1, len(means) + 1)
    panel.plot(
        number, np.abs(before), "o", ms=4, color=GREY, label=f"one scale: {np.sqrt(np.mean(before**2)):.0f} mm/s² rms"
    )
    panel.plot(
        number, np.abs(after), "o", ms=4, color=BLUE, label=f"calibrated: {np.sqrt(np.mean(after**2)):.1f} mm/s² rms"
    )
    panel.set(yscale="log", xlabel="pose", ylabel="gravity missed by, mm/s²", ylim=(0.03, 9e3))
    panel.legend(fontsize=8, frameon=False, loc="upper right", ncol=2)
    panel.set_title("2  Both sensors calibrated, every number with its error bar", loc="left", fontsize=10)


def _noise(panel):
    rest, _ = simulate(scenario_by_name("rest-hour"), seed=3)
    curve = trihedron.allan_deviation(np.deg2rad(1.0) * rest.gyroscope[:, 0] * 0.00763, rest.rate_hz)
    rate = np.rad2deg(curve.deviation) * 3600.0
    noise = trihedron.identify_noise(rest.gyroscope[:, 0] * 0.00763 * 3600.0, rest.rate_hz)
    term = noise.axes[0].terms["N"]
    panel.loglog(curve.tau_s, rate, color=BLUE, lw=1.4)
    panel.loglog(curve.tau_s, term.value / np.sqrt(curve.tau_s), color=ORANGE, lw=0.9, ls="--")
    panel.annotate(
        f"N = {term.value / 3600.0:.4f} °/s/√Hz",
        (curve.tau_s[20], 1.3 * term.value / np.sqrt(curve.tau_s[20])),
        fontsize=8,
        color=ORANGE,
    )
    panel.set(xlabel="averaging time, s", ylabel="Allan deviation of a gyro, °/h")
    panel.set_title("3  Noise measured, with intervals that hold", loc="left", fontsize=10)


def _verdict(panel):
    recording, truth = simulate(scenario_by_name("imperfect"), seed=3)
    found = trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2)
    named = "\n".join(["with", *(effect.id for effect in found.effects)])
    before = {d.domain: d.chi2_per_dof for d in found.domains}
    after = {d.domain: d.chi2_per_dof for d in found.remaining}
    names = [name for name in before if name in after and max(before[name], after[name]) > 1.1][::-1]
    y = np.arange(len(names))
    panel.barh(y + 0.2, [before[n] for n in names], height=0.38, color=GREY, label="as modelled")
    panel.barh(y - 0.2, [after[n] for n in names], height=0.38, color=BLUE, label=named)
    panel.axvline(1.0, color="black", lw=0.7, ls=":")
    panel.set_yticks(y, names, fontsize=8)
    panel.set(xscale="log", xlim=(0.5, 3e4), xlabel="misfit, χ² per degree of freedom (1: the noise explains it)")
    panel.legend(fontsize=8, frameon=False, loc="lower right")
    panel.set_title("4  What the model left out is located, named, modelled", loc="left", fontsize=10)


def main() -> None:
    """Draw and write."""
    content = png(draw())
    write_whole(OUTPUT, content, overwrite=True)
    print(f"{OUTPUT.name}: {len(content) // 1000} kB")


if __name__ == "__main__":
    main()
