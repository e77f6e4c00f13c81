"""Findings about poses and moves."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

ENTRIES = {
    ("pose-settling", "", WARNING): Words(
        "The mean drifts in {poses:# pose} (pose {which:first 8}): the second half differs from the first by up to "
        "{worst_sigmas:.1f} σ (at {worst_s:.1f} s).",
        "The support gives way, the case settles after being let go, or the sensor warms up.",
        "Wait until the case has settled, record shorter poses, or put it on a firmer support.",
    ),
    ("bias-settling", "", WARNING): Words(
        "The accelerometer settles after rotations: {x_percent:.3f}, {y_percent:.3f}, {z_percent:.3f} % (each ± "
        "{sigma_percent:.3f}) of a change of force on X, Y, Z come late, with a time constant of about {tau_s:.1f} s. "
        "The means of the poses, off by {mean_mg:.2f} mg rms, were corrected.",
        "The package or its adhesive yields after a change of load.",
        "S and b are those of the settled sensor: wait about {wait_s:.0f} s after a rotation before a reading counts.",
    ),
    ("pose-disturbed", "", NOTE): Words(
        "{disturbances:# short disturbance} in {poses:# otherwise static pose} (pose {which:first 8}), "
        "{left_out_s:.1f} s in all, the first at {first_s:.1f} s, excluded from the means.",
        "The table or the cable was touched, or samples are missing there.",
        "Nothing needs to be done; keep hands off the table while the sensor is in a pose.",
    ),
    ("pose-unsteady", "", WARNING): Words(
        "the sensor moved or vibrated throughout {poses:# pose} ({which:first 8}; first at {first_s:.1f} s).",
        "The sensor was held in the hand or stood on a support that shakes.",
        "Put the case on a firm support for a better result; the means of these poses count less.",
    ),
    ("pose-at-range-limit", "", WARNING): Words(
        "{poses:# pose} {poses:?reaches|reach} the accelerometer's range limit (first at {first_s:.1f} s, "
        "{axis:axis} at {reading:.6g}) and {poses:?is|are} excluded; clipped readings only bound gravity.",
        "{is_stuck:?The channel is stuck: with that reading the three axes exceed gravity|The range limit is below "
        "1 g plus the bias of that axis}.",
        "{is_stuck:?Check the sensor and its wiring, and record again|Set a wider range; the remaining poses are "
        "used}.",
    ),
    ("not-static", "", SERIOUS): Words(
        "No pose of {least_s:.2g} s or more in {rows:# row}, {duration_s:.1f} s of log{is_assumed:? at an assumed rate "
        "(no time column)|}.",
        "{is_short:?The log is too short, as a table of means of poses is: the readings themselves are needed|The "
        "sensor was moving, or held in the hand{is_slow:?, or its poses were too short for this rate|, all the time}}.",
        "Log again: put the case down for several seconds in each pose{is_slow:?, at 50 Hz or more|}.",
    ),
    ("poses-vibrate", "", SERIOUS): Words(
        "The sensor vibrates in its poses: the accelerometer's readings scatter by {scatter_g:.2g} g, more than any "
        "sensor's noise.",
        "Motors run, as in a flight or a drive.",
        "Record static poses with the motors off; for noise in motion: `trihedron noise LOG --reference MOTION`.",
    ),
    ("poses-vibrate", "held", WARNING): Words(
        "the sensor was not still in its poses; the gyro's means scatter as by noise of {density:.2g °/s}/√Hz, "
        "more than any sensor's.",
        "The sensor was held in the hand or stood on a support that shakes.",
        "Put the sensor down in every pose and record again: the motion makes S and b less certain.",
    ),
    ("few-poses", "", WARNING): Words(
        "{poses:# pose} found in {duration_s:.1f} s; a calibration of nine parameters needs at least {needed}, "
        "in different directions.",
        "Other poses were not logged, or held for less than {least_s:.2g} s.",
        "Record 18 or more poses of 3 to 5 s in different orientations (`trihedron plan`).",
        or_severity=SERIOUS,
    ),
    ("few-poses", "untested", WARNING): Words(
        "{poses} poses determine as many parameters of the accelerometer and leave none to test them.",
        "",
        "If the fit is to be tested, record 18 poses or more in different orientations (`trihedron plan`).",
    ),
}
