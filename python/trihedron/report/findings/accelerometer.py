"""Findings about a fitted accelerometer."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_UNQUIET = "Poses not quite static, bias drift between poses, nonlinearity, or noise of the means underestimated"
_LOOK = (
    "{is_drift:?{has_temperature:?Calibrate with the logged temperature: `trihedron calibrate LOG --extended -o FILE "
    "--force`|Let the sensor warm up and record again}|Look at the error of each pose in the whole report}; "
    "`trihedron diagnose LOG` tests which effects explain the error."
)
_ADD_POSES = "Add poses with {advice:numbered}."
_FACES_OR_POSES = (
    "{are_faces:?These are six faces of a case: run `trihedron calibrate LOG --method faces`. Or add|Add} poses with "
)
_FACES_OR_POSES += "{advice:numbered}."

ENTRIES = {
    ("residual-above-noise", "poses", WARNING): Words(
        "The gravity error in static poses is {rms_m_s2:.3g mm/s²} rms {is_held_out:?cross-validated|in sample}, "
        "{times_noise:.2g} times the noise ({is_held_out:?in sample {rms_in_sample_m_s2:.3g mm/s²}, |}noise alone "
        "{floor_m_s2:.3g mm/s²}, χ²/dof {chi2_per_dof:.3g} with {dof:.0f} degrees of freedom)"
        "{is_lone:?, most of it in pose {lone}, which the other poses hardly determine|}. {is_joint:?The bias differs "
        "between poses by {bias_repeatability_m_s2:.2g mm/s²} rms per axis{is_drift:?, with a drift of "
        "{drift_m_s2:.2g mm/s²} over the session|}; S, b and their|The} standard uncertainties allow for it.",
        "{is_drift:?The sensor warmed up, or its supply drifted|" + _UNQUIET + "}.",
        "{is_lone:?Record again with more poses near pose {lone} and in other directions (`trihedron plan`).|"
        + _LOOK
        + "}",
    ),
    ("not-observable", "poses-rank", SERIOUS): Words(
        "The poses determine {rank:.0f} of the {n_parameters:.0f} parameters of the accelerometer; not observable: "
        "{is_combined:?{missing:# combination} of |}{unseen:&, }, constrained by a prior of {anchor:.0f %} about an "
        "ideal triad.",
        "Too few different orientations: six faces alone are six equations for nine parameters.",
        _FACES_OR_POSES,
    ),
    ("not-observable", "poses-weak", SERIOUS): Words(
        "The poses determine the accelerometer so weakly that some pose could be wrong by {at_worst:.2g %} of "
        "gravity; least certain: {weakest}. A prior of {anchor:.0f %} about an ideal triad constrains all parameters.",
        "The orientations are too much alike.",
        _FACES_OR_POSES,
    ),
    ("not-observable", "poses-uncertain", SERIOUS): Words(
        "The orientations suffice, but the reading of a pose is uncertain by {measured_g:.2g %} of gravity.",
        "Too coarse a resolution (few digits, or counts taken for another unit), or a sensor that is not still.",
        "Write more digits or choose a smaller range, check the unit, and put the sensor down in every pose.",
    ),
    ("weakly-observable", "poses", WARNING): Words(
        "In some orientations gravity is predicted to {worst_prediction_g:.2g %} only (1 σ; measured in one pose to "
        "{measured_g:.2g %}); least certain: {weakest}.",
        "No pose lies near those orientations.",
        _ADD_POSES,
    ),
    ("outlier-pose", "", WARNING): Words(
        "Pose {pose} differs from what all other poses predict by {held_out_m_s2:.3g mm/s²} ({z:abs .1f} "
        "σ, limit {limit:.1f}).",
        "The sensor was touched or not static in this pose, or a reading clipped.",
        "Cut the outlier poses out of the log (`trihedron segment LOG` lists their times) and run again.",
    ),
    ("nonlinear-residual", "poses", SERIOUS): Words(
        "The gravity error in static poses has the shape of {is_quadratic:?a quadratic nonlinearity|{is_cubic:?a cubic "
        "nonlinearity{is_unlike:? or of a scale that differs between + and -|}|a scale that differs between + and -}} "
        "(odds 10^{log10_odds:.0f} against noise): poses in all directions would shift S and b by some "
        "{shift_m_s2:.2g mm/s²} at 1 g.",
        "An accelerometer that is not linear, or one driven near its range limit.",
        "Run `trihedron diagnose LOG`: it looks for the effect.",
    ),
    ("left-handed", "accelerometer", NOTE): Words(
        "The accelerometer's axes as stated form a left-handed triad: det S < 0 (signs of the diagonal {signs}).",
        "The documented axes of the board are left-handed, or one was stated wrong: poses alone do not determine "
        "signs, the moves of a gyro do.",
    ),
    ("scale-not-nominal", "accelerometer", WARNING): Words(
        "The {is_common:?common scale of all axes|scale of {axis:axis}} is {scale_ratio:.4g} although the log is in "
        "{unit:unit}.",
        "{is_common:?The log is in another unit than stated, or gravity is wrong|That axis is damaged, or its column "
        "is of another quantity}.",
        "{is_common:?State the unit of the log (--accel-unit) and gravity|Check the axis and its column}.",
    ),
    ("not-converged", "accelerometer", SERIOUS): Words(
        "The accelerometer fit did not converge ({stopped_because}).",
        "Poses contradict each other, or hardly differ.",
        "Check that every pose was static; add poses.",
    ),
    ("pose-not-a-face", "", NOTE): Words(
        "{n_left_out} of {n_poses} poses have no axis within {largest_tilt_deg:.0f}° of the vertical and are not "
        "used by --method faces (poses {poses:&, }).",
        "They are edges, corners or leaning poses.",
        "--method joint uses them all.",
    ),
    ("table-tilt", "", WARNING): Words(
        "The faces contradict each other (χ² per degree of "
        "freedom {chi2_per_dof:.3g}) as if each pose were tilted by {tilt_deg:.2g}° rms; most in pose {pose} ({face})"
        ". The standard uncertainties include this tilt.",
        "The table is not level, the case is not square or did not lie flat; bias drift looks the same.",
        "Level the table and press the case flat; or record 9 or more poses in other orientations, which need neither.",
        or_severity=SERIOUS,
    ),
    ("residual-above-noise", "verify-static", WARNING): Words(
        "The gravity error in static poses is {norm_rms_m_s2:.3g mm/s²} rms and, with each pose weighted by its "
        "uncertainty, {times:.2g} times what noise and uncertainty allow{is_offset:?, with one sign in {n_same} "
        "of {n_poses} poses, {mean_m_s2:.3g mm/s²} on average ({share:.2g %} of gravity)|}; largest for its "
        "uncertainty in pose {worst_pose} ({worst_m_s2:.3g mm/s²}){is_single:?, without which they are as expected|}.",
        "{is_single:?The sensor {is_first:?was still warming up|moved} or was touched in pose {worst_pose}|"
        "{is_bias:?Biases have changed since, scales and axes have not (warm-up, temperature, shock)|{is_few:?In the "
        "file, or in the sensor since, {shifted:ids} changed: nothing else differs from this log's own calibration|"
        "{is_offset:?Gravity or the unit is another here, or all scales have changed (temperature, supply)|{is_far:?"
        "The file is of another sensor, range or unit, or biases|Biases} and scales have changed since (temperature, "
        "shock, supply){is_far:?|, or the file is of another device}}}}}.",
        "{is_single:?Look at pose {worst_pose}; if it was static, calibrate|{is_bias:?Let the sensor warm up, then "
        "calibrate|{is_few:?Check {shifted:ids} in the file; if right, calibrate|{is_offset:?Check gravity (--gravity, "
        "--latitude) and unit; if both are right, calibrate|{is_far:?Check that file, sensor and unit belong together; "
        "if they do, calibrate|See what differs: `trihedron diagnose LOG --calibration FILE`; or calibrate}}}}} "
        "again near the conditions of use.",
        or_severity=SERIOUS,
    ),
}
