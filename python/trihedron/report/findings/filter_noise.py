"""Findings about filter noise."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

ENTRIES = {
    ("filter-noise-static", "", WARNING): Words(
        "No reference: N and K are those of this log's static intervals, without what vibration and motion add.",
        "Static intervals and gravity show neither the heading nor what happens during motion.",
        "Give the filter's own result, a tracker or a second unit with --reference MOTION.",
    ),
    ("filter-noise-static", "doubted", SERIOUS): Words(
        "The static noise of {name} is not to be trusted: {seen:clause}.",
        "Its log has this fault, which concerns every value beside which this log is held.",
        "See what it needs: `trihedron allan {name}`; then give the JSON of that with --static.",
    ),
    ("filter-noise-static", "noted", WARNING): Words(
        "Of the static log {name}: {seen:clause}.",
        "Its static values contain it; this log does not.",
        "See what it needs: `trihedron allan {name}`.",
    ),
    ("filter-noise-other-static", "", WARNING): Words(
        "The {sensor}'s static N in {name}, {static:.3g} {unit:unit}/√Hz, is {times:.2g} times that in "
        "{is_rest:?this log's own static interval|the quietest second of this log}, {own:.3g}.",
        "{is_rest:?Another part, range or filter setting; or one of the two supports shakes|Another part, range or "
        "filter setting, or a support that shakes: the noise in motion is no less than that at rest}.",
        "Give a static log of this unit, recorded with this log's settings.",
    ),
    ("filter-noise-no-static", "", NOTE): Words(
        "The static noise of the {sensor} is not known, and separable from vibration only where vibration changes.",
        "No static log was given, and the sensor is not static for 20 s in this log.",
        "Give a static log of the unit with --static STATIC.",
    ),
    ("filter-noise-below-quietest", "", WARNING): Words(
        "N of the {sensor} beside this reference is less than the noise density in the log's quietest second, "
        "{quietest:.3g}, which is stated as its upper limit.",
        "A reference computed with this unit's own readings (a filter or smoother) repeats part of their noise; or "
        "that second contains vibration.",
        "Give a static log of the unit with --static STATIC; with the limit as N a filter trusts the {sensor} less "
        "than it could.",
    ),
    ("filter-noise-not-separated", "", NOTE): Words(
        "Bias random walk of the {sensor} and the slow error of the reference are not separated here: the one that is "
        "marked 'below' has an upper limit only.",
        "Both grow slowly, and one recording contains few of their time constants.",
        "Use the limit in a filter that must not be too sure, or record longer beside a better reference.",
    ),
    ("filter-noise-followed", "", WARNING): Words(
        "The reference follows the {sensor}'s own noise: the difference is less than static noise allows. N is the "
        "static one; what motion adds to it is not visible.",
        "An attitude or path computed with this unit's own readings (a filter or smoother over camera, tracker and "
        "IMU).",
        "Take the tracker's own poses as reference.",
    ),
    ("filter-noise-inconsistent", "", WARNING): Words(
        "Cross-validated on the second half, the {sensor}'s errors over {horizon_s:.3g} s have a mean "
        "normalised square (NEES) of {nees:.2g} instead of 3; below 3 the filter is too cautious, above too sure.",
        "The two halves differ in noise, vibration or the reference's error.",
        "Treat N and K as those of the whole log only; estimate them from a log of the same kind of motion.",
    ),
    ("filter-noise-inconsistent", "tilt", SERIOUS): Words(
        "The tilt error after rotations is {actual_rad:.2g !deg}° rms over {n:# move}, {times:.2g} times what static "
        "noise predicts: a filter with it is too sure by that factor in motion.",
        "Scale and misalignment that are not corrected; else vibration, or samples that are lost in motion.",
        "Calibrate (`trihedron calibrate LOG -o calibration.json`), correct the log (`trihedron apply "
        "calibration.json LOG -o corrected.csv`) and give corrected.csv; what then remains needs --reference MOTION.",
    ),
    ("filter-noise-uncalibrated", "", WARNING): Words(
        "A calibration would remove {share:.0f %} or more of the {sensor}'s error over {horizon_s:.3g} s "
        "(scale and misalignment, g-sensitivity, temperature): more than all noise that N and K represent.",
        "The log was not corrected, or by outdated parameters. Such errors follow the motion: no noise of a "
        "filter represents them.",
        "Calibrate first, correct the log with that, and estimate N and K from the corrected log.",
    ),
    ("filter-noise-uncertain", "", WARNING): Words(
        "N of the {sensor} is uncertain: between {lower:.3g} and {upper:.3g} (95 % interval), and a filter is too sure "
        "with the one and too cautious with the other.",
        "The reference's own error, or a residual calibration error, is larger than the sensor's noise.",
        "Give {has_static:?|a static log of the unit (--static STATIC), }a better reference or a longer log; for a "
        "filter that must not be too sure replace N {in_file:.3g} of the {sensor} by {upper:.3g}.",
    ),
    ("filter-noise-uncertain", "limit", WARNING): Words(
        "N of the {sensor} was not measured: {upper:.3g} is an upper limit, and may be several times too large.",
        "The reference's own error is larger than the sensor's noise.",
        "Give {has_static:?|a static log of the unit (--static STATIC) or }a better reference; with the limit as N a "
        "filter trusts the {sensor} less than it could.",
    ),
    ("filter-noise-uncertain", "reference", WARNING): Words(
        "Over {horizon_s:.3g} s the reference's own error is {share:.0f %} of the {sensor}'s error: N and K come from "
        "what little remains.",
        "The reference is less accurate than the sensor over this time.",
        "Give a better reference{has_static:?|, or a static log of the unit (--static STATIC)}.",
    ),
    ("filter-noise-unsettled", "", WARNING): Words(
        "The search for the {sensor}'s strengths did not settle: its intervals come from a few draws.",
        "The log contains too little motion, or noise that none of the causes describes.",
        "Do not rely on these intervals; give a longer log, or one without shocks.",
    ),
}
