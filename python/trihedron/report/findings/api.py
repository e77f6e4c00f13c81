"""Findings of ``api``: gravity, limits, temperature, many recordings, applied and compared calibrations."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_MANY = "{is_other:?Check the unit, range and rate of that recording, and calibrate the others without it|The common "
_MANY += "parameters are the mean of different ones: use the spread below as their error, or recalibrate after the "
_MANY += "change}."

_CALIBRATE = {
    ("gravity-defaulted", "", WARNING): Words(
        "Gravity was not given; {gravity_m_s2} m/s² was used. Where people live it lies between {low_m_s2:.3f} and "
        "{high_m_s2:.3f} m/s², and its error goes into every scale and bias of the accelerometer: up to "
        "{possible_error_percent:.1f} % that no residual shows and no ± contains.",
        "Neither --gravity nor --latitude was given.",
        "Give --latitude DEG (and --height M), or --gravity M_S2: without it scales may be off by "
        "{possible_error_percent:.1f} %.",
    ),
    ("turn-angle-unknown", "", WARNING): Words(
        "Some turns on the table are not used: the gyro's scale is not known well enough to say which multiple of 90° "
        "each of them is.",
        "Few moves turn gravity, and no smaller turn about that axis is known.",
        "Give --turns 180,-180,... (one angle a turn, 0 excludes it).",
    ),
    ("gyroscope-left-out", "not-calibrated", WARNING): Words(
        "The gyro was not calibrated: {why}.",
        "The recording does not contain what the gyro needs.",
        "Turn the sensor about all three axes between poses, by 60 to 180° in 2 to 4 s.",
    ),
    ("gyroscope-left-out", "clipped", WARNING): Words(
        "The gyro was not calibrated: it clipped in {n_lost} of {n_moves} moves, and the others do not determine its "
        "scale.",
        "The sensor was turned faster than its range limit.",
        "Record again with rates below about half the range limit, or set a wider range.",
    ),
    ("not-fit", "no-calibration", SERIOUS): Words(
        "No calibration can be made from this log: {why}.",
        "The log does not contain what a calibration needs.",
        "Log both sensors while you set the sensor down in 18 or more different poses, still for 3 to 5 s in each.",
    ),
    ("not-fit", "static-log", SERIOUS): Words(
        "This is a static log: nearly all static time of its {duration_s:.0f} s is in one or two orientations, which "
        "do not determine S and b.",
        "A log for noise or of a temperature chamber.",
        "For noise: `trihedron allan LOG`; for drift and temperature: `trihedron diagnose LOG`. For S and b record 18 "
        "or more poses of 3 to 5 s in different directions.",
    ),
    ("not-fit", "same-poses", SERIOUS): Words(
        "{n_poses} poses with motion between them read nearly the same: gravity was not turned in these axes.",
        "The readings are a gyro's and were taken for an accelerometer's; or the unit was moved without turning it.",
        "Name the columns with --columns; a gyro's log goes with --gyro, beside --accel. For S and b record 18 or more "
        "poses of 3 to 5 s in different directions.",
    ),
    ("not-fit", "short-static-log", SERIOUS): Words(
        "This is a static log of {duration_s:.3g} s: one or two orientations do not determine S and b, and it is too "
        "short for noise.",
        "A log that was stopped early, or before the sensor was turned.",
        "For S and b record 18 or more poses of 3 to 5 s in different directions; for noise {least_s:.0f} s or more, "
        "an hour is useful.",
    ),
    ("not-fit", "few-orientations", NOTE): Words(
        "One or two orientations in {duration_s:.0f} s: scales, angles between axes and moves are not tested.",
        "A static log, a chamber log or a table that does not move.",
        "To test those too, record 18 or more poses of 3 to 5 s in different directions.",
    ),
}

_FORCE = "In quiet intervals the corrected |f| is {norm_m_s2:.5g} m/s²"
_USE = {
    ("gyroscope-left-out", "one-has-none", WARNING): Words(
        "The gyro was excluded: the {which} has none.",
        "Only the accelerometer was logged or calibrated, or only its columns were found.",
        "Give a {which} with both sensors.",
    ),
    ("static-force", "", NOTE): Words(
        f"{_FORCE} (1 σ {{sigma_m_s2:.2g}} m/s²), which agrees with gravity ({{gravity_m_s2:.5g}} m/s²).",
        action="Errors of every pose and move: `trihedron verify FILE LOG`.",
    ),
    ("static-force", "off", WARNING): Words(
        f"{_FORCE}, {{share:.2g %}} off gravity ({{gravity_m_s2:.5g}} m/s²); its scatter and the calibration's "
        "uncertainty explain {sigma_m_s2:.2g} m/s² (1 σ).",
        "The scale or bias has changed since the calibration (temperature, shock, another range), or the unit is "
        "another one.",
        "Check it on this log: `trihedron verify FILE LOG`.",
    ),
    ("static-force", "scatter", WARNING): Words(
        "in quiet intervals the corrected |f| differs from stretch to stretch by {sigma_m_s2:.2g} m/s² (1 σ); its "
        "mean is {norm_m_s2:.5g} m/s² and gravity {gravity_m_s2:.5g} m/s².",
        "The calibration is of another sensor or range, or the sensor was not still.",
        "Test it on this log: `trihedron verify FILE LOG`.",
    ),
    ("static-force", "far", SERIOUS): Words(
        f"{_FORCE}, but gravity {{gravity_m_s2:.5g}} m/s².",
        "The calibration is of another sensor, or the log in another unit or range than it was made for.",
        "Check that calibration and log belong together: `trihedron verify FILE LOG`.",
    ),
    ("calibration-doubted", "", SERIOUS): Words(
        "The calibration itself is not to be trusted: {seen}",
        "Its own recording had this fault, which concerns everything the calibration is applied to.",
        "{action} Calibrate again, or apply another calibration.",
    ),
    ("effect-not-applied", "of-session", NOTE): Words(
        "The {effect:ids} of the extended calibration was not compensated: {why}.",
        "It was in the recording that was calibrated; S and b were fitted beside it.",
    ),
    ("effect-not-applied", "", WARNING): Words(
        "The {effect:ids} of the extended calibration was not compensated: {why}.",
        "It was in the recording that was calibrated; S and b were fitted beside it.",
        "Use a log that has what it needs ({why}), or update the program that applies the calibration.",
    ),
    ("limit-exceeded", "static", SERIOUS): Words(
        "The gravity error in static poses is {rms_m_s2:.3g mm/s²} rms ({rms_m_s2:.3g mg}); the limit is "
        "{limit_mg:g} mg{is_below_noise:?, less than the noise of this log's poses alone|}.",
        "{is_below_noise:?Poses too short, or too noisy a sensor, for this limit|The calibration is less accurate "
        "here than required}.",
        "{is_below_noise:?Record longer poses|See what the errors are: `trihedron diagnose LOG --calibration FILE`. "
        "Then calibrate again}, or accept a wider limit.",
    ),
    ("limit-exceeded", "moves", SERIOUS): Words(
        "The tilt error after a rotation is {rms_deg:.3g} deg rms; the limit is {limit_deg:g} deg"
        "{is_below_noise:?, less than the noise of this log's rotations alone|}.",
        "{is_below_noise:?Rotations too slow, or too noisy a sensor, for this limit|The calibration is less accurate "
        "here than required}.",
        "{is_below_noise:?Record quicker rotations between longer poses|See what the errors are: "
        "`trihedron diagnose LOG --calibration FILE`. Then calibrate again}, or accept a wider limit.",
    ),
    ("same-recording", "", SERIOUS): Words(
        "The calibration was made from this recording: a verification with it proves nothing.",
        "The same file, or one of several that were calibrated together.",
        "Verify on another session; the calibration report already has cross-validated errors.",
    ),
    ("outside-valid-range", "", SERIOUS): Words(
        "{n_outside} of {n_samples} samples were recorded outside {low_degc:.1f} to {high_degc:.1f} °C, for which the "
        "calibration was made (the log: {log_low_degc:.1f} to {log_high_degc:.1f} °C).{ends_are_held:? S and b of the "
        "nearer end were used there.|}",
        "The calibration has no data at such temperatures; a polynomial is not extrapolated.",
        "Calibrate at these temperatures too, or exclude those samples.",
    ),
    ("temperature-missing", "", SERIOUS): Words(
        "The calibration follows temperature ({low_degc:.1f} to {high_degc:.1f} °C) and the log has none: S and b of "
        "its reference temperature were used.",
        "No temperature column was logged, or it was not recognised.",
        "Log the sensor's temperature; name its column with --columns temperature=N.",
    ),
}

_DIAGNOSE = {
    ("effects-modelled", "stays-linear", WARNING): Words(
        "The calibration stays linear: with {effects:ids} the cross-validated error grows ({domain:ids} from "
        "{rms_before:.3g} to {rms_after:.3g} {unit:unit} rms).",
        "The effects belong to this session more than to the sensor, or its poses are too few to determine their size.",
        "`trihedron diagnose` shows them; record another session to see which of them return.",
    ),
    ("effects-modelled", "undetermined", SERIOUS): Words(
        "The calibration stays linear: beside {effects:ids} nothing determines the gyro's S.",
        "The moves that show it are those that the effects spoil.",
        "Record moves that these effects do not reach; `trihedron diagnose` shows which were excluded.",
    ),
    ("effects-modelled", "", NOTE): Words(
        "{is_fitted:?S and b were fitted together with {effects:ids}|The diagnosis accepted no effect: the linear "
        "model is unchanged}{is_left:?; unexplained: {left:ids}|}.",
        "{is_fitted:?The linear model alone does not reproduce this recording: {statements:&; }.|}",
        "{is_left:?{is_fitted:?Record again: what returns belongs to the sensor, what does not to the session."
        "|`trihedron diagnose` shows where it occurs.}|{is_fitted:?`trihedron apply` compensates the effects that "
        "belong to the sensor; S and b alone are only part of this model.|}}",
        or_severity=WARNING,
    ),
    ("bias-drift", "", WARNING): Words(
        "The bias of the {is_gyro:?gyro|accelerometer} changed by up to {change:quantity} in the recording that was "
        "calibrated, and b is its mean; `trihedron apply` does not follow the change.",
        "{is_warm:?The sensor warms up|Temperature, supply or ageing}.",
        "{is_warm:?Record again with a warm sensor, and let it warm up before use|Measure the bias in a static pose "
        "before use}.",
    ),
}

_CHANGED_CAUSE = {
    "bias": "A calibration shift between sessions (turn-on, mounting, temperature, age).",
    "scale": "Temperature, stress or the gravity that was given.",
    "misalignment": "Stress in the package or the board, or another unit.",
    "alignment": "One of two parts was remounted, or another unit.",
    "accel-common-scale": "{is_other:?Another unit or measuring range|Another gravity than given, or temperature}.",
    "gyro-common-scale": "{is_other:?Another unit, measuring range or sampling rate|Another clock, or temperature}.",
}
_CHANGED_SEEN = {
    "differs": "in {where} differs from that in the other recording, by {amount}",
    "apart": "in {where} differs from all other recordings, by {amount}",
    "step": "changed before {where}, by {amount}",
    "trend": "changes from recording to recording, by {amount} each",
    "scatter": "differs in every recording, by {amount} (standard deviation)",
}
_MANY_RECORDINGS = {
    ("session-left-out", "", WARNING): Words(
        "Recording {name} was excluded: {why}.",
        "This recording alone does not determine a calibration; the others are used.",
        "Run `trihedron check {path}`.",
    ),
    ("clipping", "of-recordings", WARNING): Words(
        "in {n} of {n_all} recordings {seen:clause}; these are the figures of {name}.",
        "The motion left the measuring range; clipped moves count less, or are excluded.",
        "Turn with rates below about half the range limit, move gently, or set a wider range; `trihedron check {path}` "
        "says where.",
    ),
    ("calibration-doubted", "of-recordings", WARNING): Words(
        "in {n} of {n_all} recordings alone {seen:clause}; these are the figures of {name}.",
        "What S and b of each recording leave, the common ones leave as well; their uncertainty is widened by it.",
        "Run `trihedron diagnose {path}`, which looks for the cause.",
    ),
    ("calibration-doubted", "others", NOTE): Words(
        "Further warnings of single recordings: {recordings:each; }.",
        action="`trihedron calibrate` of that recording says where and why.",
        lines={"recordings": "{v0}: {v1:ids}"},
    ),
    ("few-sessions", "", NOTE): Words(
        "Only {n_groups} {kind}: the spreads are uncertain by a factor of several, as their intervals show.",
        "A standard deviation of few values is uncertain whatever is done with them.",
        "Record {wanted} or more.",
    ),
    ("temperature-driven", "", WARNING): Words(
        "The recordings were made between {low_degc:.0f} and {high_degc:.0f} °C, and their spread includes the effect "
        "of temperature.",
        "Biases and scales of every part follow temperature.",
        "Use --by temperature.",
    ),
    ("several-devices", "", WARNING): Words(
        "The {parameter:ids} differs between the recordings: {amount}.",
        "Recordings of different units; in one unit axes keep their directions, and a scale changes by less than 1 %.",
        "Diagnose the recordings of one unit together; what recordings of different units share is of the design.",
    ),
    ("several-devices", "calibrated", WARNING): Words(
        "The {parameter:ids} differs between the recordings: {amount}.",
        "Recordings of different units; in one unit axes keep their directions, and a scale changes by less than 1 %.",
        "Calibrate the recordings of each unit by themselves: common parameters of several units fit none of them.",
    ),
    **{
        ("parameters-changed", f"{parameter}-{kind}", WARNING): Words(
            f"The {{parameter:ids}} {seen}.",
            cause,
            _MANY,
            or_severity=SERIOUS,
        )
        for parameter, cause in _CHANGED_CAUSE.items()
        for kind, seen in _CHANGED_SEEN.items()
    },
}

ENTRIES = {**_CALIBRATE, **_USE, **_DIAGNOSE, **_MANY_RECORDINGS}
