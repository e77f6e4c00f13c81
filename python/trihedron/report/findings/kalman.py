"""Findings about a Kalman filter's result and its innovations."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_OF_AXES = {
    key: words
    for case, name, error, remedy in (
        (
            "axis",
            "Accelerometer {axis:axis}",
            "a reference attitude is wrong",
            "Check the reference attitudes{has_first:? from pose {first_pose} on|}; if they are right, identify the "
            "noise anew",
        ),
        (
            "norm",
            "Norm of gravity",
            "the axes are not linear",
            "See what the readings have beside noise: `trihedron diagnose LOG`",
        ),
    )
    for key, words in {
        ("innovations-too-large", case, WARNING): Words(
            f"{name}: squared innovations are {{nis_mean:.3g}} times what the noise model predicts"
            "{has_first:?, first in pose {first_pose}|} (99 % limit {nis_high:.2f}).",
            f"The noise is larger than the model says, or {error}.",
            f"{remedy}; until then the uncertainties are multiplied by {{widening:.2g}} for it.",
        ),
        ("innovations-too-small", case, NOTE): Words(
            f"{name}: squared innovations are only {{nis_mean:.2f}} times what the noise model predicts (99 % limit "
            "{nis_low:.2f}).",
            "The noise is smaller than the model says.",
            "The uncertainties are too wide; identify the noise anew if that matters.",
        ),
        ("innovations-correlated", case, WARNING): Words(
            f"{name}: innovations are correlated from pose to pose (Ljung-Box p = {{whiteness_p:.1e}} over {{n_lags}} "
            "lags, first autocorrelation {autocorrelation_1:+.2f}).",
            f"Bias drift or temperature that the noise model lacks, or {error}.",
            "Look at the innovations against time and attitude; add the missing noise term.",
        ),
    }.items()
}

ENTRIES = {
    **_OF_AXES,
    ("not-converged", "kalman", SERIOUS): Words(
        "The constants still changed after {most_runs} runs over all poses.",
        "The start is too far away, or the poses do not determine the constants.",
        "Give a start near the data sheet, and poses in more directions.",
    ),
    ("weakly-observable", "attitudes", WARNING): Words(
        "The attitudes determine the {weakest} {condition:.0f} times worse than the best one.",
        "The poses do not turn every axis towards the vertical, both ways up.",
        "Add poses: {advice}.",
    ),
    ("noise-assumed", "", NOTE): Words(
        "Noise was taken from the scatter inside the poses; bias drift from pose to pose is not known.",
        "No --noise was given.",
        "Give a static log of an hour (--noise static.csv), or check the innovations.",
    ),
}
