"""Findings of ``verify``: parameters that differ, errors larger than without a calibration, what is not tested."""

from trihedron.report.findings.entry import SERIOUS, WARNING, Words

ENTRIES = {
    ("calibration-shift", "", WARNING): Words(
        "{n_parameters:.0f} of {n_judged:.0f} parameters that this log can judge differ from the file by more than "
        "both uncertainties and the bias drift in this log allow, {first:ids} by {times_sigma:.0f} σ; log − file: "
        "{parameters:each}.",
        "A calibration shift between sessions (temperature, shock, bias repeatability), or a file of another device.",
        "Check that the file is of this sensor (table of parameters in the whole report); several sessions calibrated "
        "together give the repeatability of each.",
        lines={"parameters": "{v0:ids} {v1:quantity}"},
    ),
    ("calibration-shift", "gyro-bias-alone", WARNING): Words(
        "The gyro bias changed since the calibration by {parameters:each}, up to {times_sigma:.0f} times what both "
        "uncertainties and the bias drift in this log allow.",
        "Repeatability of the gyro bias (turn-on, temperature), which a calibration of one session does not contain.",
        "Measure the calibrated rate in a static pose before use and subtract it; several sessions calibrated together "
        "give its repeatability.",
        lines={"parameters": "{v1:quantity} ({v2:axis})"},
    ),
    ("worse-than-uncalibrated", "verify-static", SERIOUS): Words(
        "Worse than no calibration: the gravity error in static poses is {rms:.3g mm/s²} rms with it and "
        "{rms_without:.3g mm/s²} without.",
        "{is_few:?In the file, or in the sensor since, {shifted:ids} changed: nothing else differs from this log's own "
        "calibration|A wrong file, unit, axis or sign, or a calibration of too few poses}.",
        "Do not use it: check {is_few:?{shifted:ids} in the file|that the file is of this sensor, in the log's units}.",
    ),
    ("worse-than-uncalibrated", "reference", WARNING): Words(
        "The accelerometer is not improved: the gravity error in static poses is {rms_m_s2:.3g mm/s²} rms with this "
        "calibration, uncertain by {expected_m_s2:.2g mm/s²}, and {rms_without_m_s2:.3g mm/s²} without.",
        "Motion determines the accelerometer less accurately than the uncorrected readings are.",
        "Use the gyro alone; calibrate the accelerometer in 18 or more static poses (`trihedron plan`).",
    ),
    ("worse-than-uncalibrated", "verify-moves", SERIOUS): Words(
        "Worse than no calibration: the tilt error after a rotation is {rms:.3g}° rms with it and {rms_without:.3g}° "
        "without.",
        "{is_few:?In the file, or in the sensor since, {shifted:ids} changed: nothing else differs from this log's own "
        "calibration|{is_common:?All gyro scales differ by one factor ({common:+.2g %}): the clock or rate of one of "
        "the two logs is off by it, or the gyro's sensitivity has changed|A wrong file, unit, axis, sign or clock, or "
        "a calibration of too few rotations}}.",
        "Do not use it: check {is_few:?{shifted:ids} in the file|that the file is of this sensor, in the log's units, "
        "with its right clock (--time-unit, or `--columns time=none --rate HZ`)}.",
    ),
    ("not-tested", "", WARNING): Words(
        "Most parameters of the {sensors:& and } are not tested: {poses:# pose} and {moves:# move} of this log do not "
        "determine them.",
        "Few orientations or rotations: an error of the calibration that shows in others passes.",
        "Record 9 or more poses in different orientations, with rotations between them, and verify on that log.",
    ),
    **{
        ("calibration-imprecise", case, WARNING): Words(
            f"The {error} is {{times:.2g}} times that of this log's own calibration, cross-validated, yet within the "
            "uncertainty of the calibration (p = {p:.1g}).",
            "A calibration of few poses, or one whose biases return within a wide range.",
            "Use this log's own calibration, which is more certain: `trihedron calibrate LOG`.",
        )
        for case, error in (("static", "gravity error in static poses"), ("moves", "tilt error after a rotation"))
    },
    ("calibration-shift", "gyro-bias", SERIOUS): Words(
        "In static poses the calibrated gyro reads {rate_rad_s:.3g °/s}, {times_expected:.0f} times what the bias "
        "repeatability of typical gyros, the scatter of the poses and the stated uncertainty allow "
        "({sigma_rad_s:.2g °/s}){is_alone:?|: not its bias alone has changed}.",
        "A bias with the wrong sign or unit, of another sensor, or of another temperature.",
        "{is_alone:?Do not subtract this bias; measure it in a static pose before use|Check that the file is of this "
        "sensor, in the units of the log; if it is, calibrate again}.",
    ),
}
