"""Findings about the comparison of a log with known motion, or with another log."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

ENTRIES = {
    ("reference-turned-round", "", WARNING): Words(
        "The reference's attitudes turn world into body: only so do they move as the log does.",
        "Two conventions of attitude.",
        "Nothing, unless another program will read this file.",
    ),
    ("reference-not-independent", "", WARNING): Words(
        "The reference is not independent of this gyro"
        "{is_quiet:?: it follows the gyro's own noise|}"
        "{is_square:?: it lies within {angle_rad:.2g deg} of the gyro's axes|}.",
        "An attitude computed with this unit's own readings (a filter or smoother over camera, tracker and IMU).",
        "Take S and b as confirmed by the reference, not as measured; use the tracker's own poses to measure them.",
    ),
    ("reference-apart", "", WARNING): Words(
        "the reference deviates from the remaining log in {n:# interval} from {start_s:.0f} to {end_s:.0f} s.",
        "A tracker that lost its markers or was re-initialised, or a reference that turned on the body.",
        "Look at the reference's own quality flags from {start_s:.0f} to {end_s:.0f} s, or leave that part out.",
    ),
    ("reference-apart", "slipped", SERIOUS): Words(
        "The reference turned on the body by {angle_rad:.2g deg} at {at_s:.0f} s: before and after, its mounting is "
        "constant but not the same.",
        "It slipped, or its tracked body was defined anew.",
        "Cut the reference's file there, and give `calibrate` the log twice with `--reference BEFORE --reference "
        "AFTER`: each part has its mounting then.",
    ),
    ("reference-apart", "slipped-in-noise", WARNING): Words(
        "the reference turned on the body by {angle_rad:.2g deg} at {at_s:.0f} s, which adds to its own error and so "
        "to what is predicted, not to N; the slip makes K less certain.",
        "It slipped, or its tracked body was defined anew.",
        "Cut the reference's file at {at_s:.0f} s, and run `trihedron noise` with either part.",
    ),
    ("reference-misfit", "", WARNING): Words(
        "Parts of the log disagree about the {sensor} by {widened:.2g} times what its residuals' noise explains; the "
        "uncertainties were widened by that.",
        "A reference that wobbles or was corrected on the way, a bias that drifts, an effect.",
        "Look at --report FILE.html for where; repeat the motion.",
    ),
    ("reference-outliers", "", WARNING): Words(
        "{left_out} of {rows} rows of the reference were excluded as outliers.",
        "Jumps of a tracker that lost its markers, or impacts.",
        "Look at the reference's own quality flags.",
    ),
    ("reference-upside-down", "", WARNING): Words(
        "In static poses the specific force points along -Z of the reference's world.",
        "Its z points down (north, east, down), or the reference is mirrored, or the log's accelerometer shows gravity "
        "instead of specific force.",
        "If z is up there, turn the sign of one axis of the reference, or of the accelerometer.",
    ),
    ("reference-of-itself", "", WARNING): Words(
        "The reference stands in the log's own file.",
        "An attitude that the unit computed from its own gyro agrees with that gyro by construction.",
        "Believe it only if another instrument measured it.",
    ),
    ("reference-only", "", NOTE): Words("Only the reference was used: {why}.", "The log has too few poses."),
    ("accelerometer-nominal", "", WARNING): Words(
        "The accelerometer was not calibrated: the reference has no force. Its parameters in the file are nominal.",
        "A rate alone says nothing of gravity.",
        "Use the gyro alone: its frame is the reference's body, not the accelerometer's axes. Or calibrate from poses "
        "(`trihedron calibrate LOG`).",
    ),
    ("shared-motion", "", NOTE): Words(
        "Both logs show the same motion (correlation {correlation:.3f}, the other clock {offset_s:+.5g} s): compared "
        "sample by sample they differ by {rate_rms:.3g °/s}{has_force:? and {force_rms:.3g mm/s²}|} rms.",
        "A motion that was replayed, or two units on one body.",
    ),
}
