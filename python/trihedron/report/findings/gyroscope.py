"""Findings about a fitted gyro: by moves, by turns of known angle, by the fit of a whole session."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_CONTRADICTING = "rotations that contradict each other, or a start far from the truth."
_LOOK_AT_MOVES = "Look at the residual per move; give the nominal scale."
_OUTSIDE_THE_MODEL = (
    "an effect outside the linear model: g-sensitivity, a time offset between the sensors, nonlinearity; or samples "
    "that were lost without a trace in the timestamps."
)
_BIAS_CHANGES = "warm-up, bias drift, or a bias that depends on attitude (g-sensitivity)."
_WRONG_TURN = (
    "turn {turn} ({at_s:.1f} s), taken as {angle_rad:.0f deg} about {axis:axis}, is off by {deviation_rad:.2g deg} "
    "against the "
)
_ANOTHER_TURN = "the case did not touch the wall, or the turn was another one."
_CORRECT_ITS_VALUE = "Correct value {turn} of --turns (0 leaves the turn out), or repeat the turn."
_CORRECT_OR_REPEAT = f"{{is_stated:?{_CORRECT_ITS_VALUE}|Repeat this turn.}}"
_SAME_GRAVITY = "turns about the vertical leave gravity where it was, and a whole turn brings it back."

_MOVES = {
    ("turntable", "", NOTE): Words(
        "{turns:.0f} steady turns of a table at known speed were fitted: |S w′ + b| within {rms_percent:.2g} % rms of "
        "what was stated."
    ),
    ("turntable", "contradicting", WARNING): Words(
        "moves and poses give {seen_rad_s:.4g °/s} where {stated_rad_s:.4g °/s} is stated; they differ from the "
        "speeds of {turns:.0f} steady turns by {common_percent:+.2g} % on average, {rms:.2g %} rms, more than noise "
        "explains; each was given that uncertainty.",
        "another speed than stated, a table that does not keep it, or a sensor that S and b do not describe.",
        "Correct --turntable, by the turns in a minute, or state --turntable-error.",
    ),
    ("turntable", "not-fitted", SERIOUS): Words(
        "the fit to {turns:.0f} {is_turned:?turns by stated angles|steady turns at stated speeds} did not converge: it "
        "is off by {rms:.2g %} rms, more than noise explains; they are left out.",
        "another {is_turned:?angle|speed} than stated, or moves that hardly determine the gyro.",
        "Check --turn{is_turned:?s|table}; turn the sensor about all three axes between poses of many orientations.",
    ),
    ("turntable", "turns", NOTE): Words(
        "{turns:.0f} turns by stated angles were fitted beside poses and moves: |∫ω dt| within {rms_rad:.2g deg} rms "
        "of what was stated."
    ),
    ("not-converged", "session", SERIOUS): Words(
        "the fit of the session did not converge ({stopped_because}).", _CONTRADICTING, _LOOK_AT_MOVES
    ),
    ("residual-above-noise", "moves", WARNING): Words(
        "the tilt error after rotations exceeds what noise explains: χ²/dof = {chi2_per_dof:.1f} with {dof:.0f} "
        "degrees of freedom; the rotations are weighted by the noise that they show.",
        _OUTSIDE_THE_MODEL,
        "See which effect it is: `trihedron diagnose LOG`.",
        or_severity=SERIOUS,
    ),
    ("scale-not-nominal", "gyro", SERIOUS): Words(
        "The common scale of all gyro axes, read in {unit:unit}, is {scale_ratio:.4g} (1 where unit and clock are "
        "right).",
        "A wrong unit; or, if the unit is right, each time interval lasts {scale_ratio:.4g} times as long as it was "
        "read.",
        "{has_fitting:?Read it with --gyro-unit {fitting}; or with|With} `--columns time=none --rate {right_hz:.3g}` "
        "the scale is 1{has_fitting:?|; if that is no possible rate, read it with --gyro-unit counts}.",
    ),
    ("scale-not-nominal", "gyro-common", WARNING): Words(
        "all three gyro scales are {excess:+.2g %} off in {unit:unit}; they agree within {spread:.1g %} (1 σ), and "
        "data sheets allow about {nominal:.1g %}, axis by axis.",
        "the sampling rate or the timestamps are off by that factor, which looks like the sensor's sensitivity.",
        "If the log did not last as long as its timestamps say (a clock tells), they or the rate are wrong by "
        "{excess:abs .2g %}: record again, or give --columns time=none and --rate.",
    ),
    ("left-handed", "gyro-reversed", WARNING): Words(
        "gyro {axis:axis} turns against accelerometer {axis:axis}.",
        "its documented direction is wrong, or its sign was changed.",
        "Check the axis directions of the board; the calibration itself corrects the gyro's.",
    ),
    ("left-handed", "accelerometer-reversed", WARNING): Words(
        "accelerometer {axis:axis} points against gyro {axis:axis}.",
        "its documented direction is wrong, or its sign was changed; or gyro {axes:axes and} are both reversed.",
        "Compare the axis directions of the board with a pose with {axis:axis} up; if the accelerometer is reversed, "
        "state --axis-signs={signs}.",
    ),
    ("left-handed", "both-sensors", WARNING): Words(
        "every gyro axis turns against the accelerometer's axis of the same name: the axes of both sensors are of the "
        "other handedness than stated.",
        "{is_stated:?the signs of --axis-signs are those of a left-handed board, and this one is right-handed|one "
        "documented axis of the board is reversed, or two are exchanged, alike for both sensors}; or all three gyro "
        "axes are reversed.",
        "{is_stated:?Leave --axis-signs out, or check its signs|Check the axis directions of the board and state the "
        "accelerometer's with --axis-signs, for example --axis-signs=-++}; the calibration itself corrects the gyro's.",
        or_severity=SERIOUS,
    ),
    ("left-handed", "gyro-other-axes", WARNING): Words(
        "gyro X, Y and Z turn about accelerometer {directions:each}.",
        "the axes of one of the two sensors are in another order, or have other signs, than stated.",
        "Check the axis directions of the board against both data sheets{has_columns:?; if the columns are in another "
        "order, read it with --columns {mapping}|}; the calibration itself corrects the gyro's.",
        lines={"directions": "{v0:?−|}{v1:axis}"},
    ),
    ("left-handed", "gyro-turned", NOTE): Words(
        "the gyro is turned against the accelerometer by {angle_deg:.1f}° about the axis {about:all .2f}.",
        "it is mounted so, or one of the two sensors was read with another frame than stated.",
        "Compare the angle with the board; S of the gyro contains the rotation.",
    ),
    ("left-handed", "gyro-mirrored", WARNING): Words(
        "the gyro's axes are of the other handedness than the accelerometer's, and along none of them.",
        "one documented axis of either sensor is reversed, or two are exchanged, and the gyro is turned against the "
        "accelerometer.",
        "Check the axis directions of the board against both data sheets; the calibration itself corrects the gyro's.",
    ),
    ("outlier-move", "timed", WARNING): Words(
        "move {move} at {start_s:.1f} s (pose {before} to pose {after}) has a tilt error of {residual_deg:.2g}°, "
        "{times:.0f} times its noise, and is excluded.",
        "one of its poses was not static, samples were lost, or the gyro was driven beyond its range limit.",
        "Repeat the outlier moves; `trihedron diagnose LOG` tests what disturbed them.",
    ),
    ("outlier-move", "gap", WARNING): Words(
        "move {move} at {start_s:.1f} s (pose {before} to pose {after}) has lost samples and is excluded: its tilt "
        "error is {residual_deg:.2g}°.",
        "the logger lost samples while the sensor moved.",
        "Repeat the moves with lost samples, at a rate that the link sustains.",
    ),
    ("gyro-g-sensitivity", "", NOTE): Words(
        "the gyro's bias follows gravity, as by g-sensitivity, up to {per_g_rad_s:± sigma_per_g_rad_s °/s} "
        "per g ({rate_axis:axis} for force along {force_axis:axis}). S and b are those beside it and alone cannot "
        "correct it.",
        "{may_be_earth:?the rotation of the Earth ({earth_rad_s:.2g °/s}), or |}g-sensitivity of the gyro.",
        "Separate g-sensitivity from a bias that differs from pose to pose: `trihedron diagnose LOG`; --extended fits "
        "g-sensitivity.",
        or_severity=WARNING,
    ),
    ("gyro-bias-drift", "poses", NOTE): Words(
        "the gyro's bias changes between poses by up to {change_rad_s:.2g °/s} ({axis:axis}), {times:.1f} times its "
        "noise; each move uses the biases of the two poses next to it.",
        _BIAS_CHANGES,
        "Let the sensor warm up; use the stated bias only near this temperature.",
    ),
    ("gyro-bias-drift", "drifts", WARNING): Words(
        "the gyro's bias drifts while the log runs, by up to {change_rad_s:.2g °/s} ({axis:axis}), {times:.1f} times "
        "its noise; the stated b is its mean, valid neither before nor after. S accounts for the drift.",
        _BIAS_CHANGES,
        "Where the log has a temperature, calibrate with --extended; else let the sensor warm up and record again, or "
        "measure the bias in a static pose before use.",
    ),
    ("not-observable", "moves-rank", SERIOUS): Words(
        "the moves determine {rank} of {n_parameters} gyro parameters; least certain: {weakest}.",
        _SAME_GRAVITY,
        "{advice:sentences}",
    ),
    ("not-observable", "moves-clipped", SERIOUS): Words(
        "the gyro clipped in {left_out} of {n_moves} moves, which are excluded: the others determine {rank} of "
        "{n_parameters} gyro parameters; least certain: {weakest}.",
        "the sensor was turned faster than its range limit.",
        "Turn with rates below about half the range limit, or set a wider range.",
    ),
    **dict.fromkeys(
        (("not-observable", "moves-weak", SERIOUS), ("weakly-observable", "moves", WARNING)),
        Words("the moves hardly determine the {weakest}: see its σ in S.", _SAME_GRAVITY, "{advice:sentences}"),
    ),
    ("samples-lost", "seen-in-motion", WARNING): Words(
        "Samples are missing though the timestamps run on evenly: the motion jumps across {losses} of {joints} "
        "intervals that would show it (first at {first_s:.2f} s): about {lost_share:± sigma_lost_share %} "
        "of the samples, and of every turn, are lost. The gyro's scale factors are too large by about that.",
        "A link or a logger that drops samples and renumbers the others, or timestamps them anew.",
        "Lower the rate or the load of the link and record again; or put single losses back by a fit with effects: "
        "`trihedron calibrate LOG --extended -o FILE --force`. Do not use this gyro calibration.",
        or_severity=SERIOUS,
    ),
    ("left-handed", "turns-against-moves", SERIOUS): Words(
        "The moves between poses contradict the sense of the turns: by them the gyro turned the other way in all "
        "{turns:.0f}.",
        "The accelerometer's axes form a left-handed triad as documented, or the turns were stated the other way "
        "round.",
        "State the directions of the board's axes with --axis-signs, or turn the signs of --turns.",
    ),
    ("losses-possible", "", SERIOUS): Words(
        "Tilt errors after rotations are as if samples were lost without a trace in these timestamps: up to "
        "{lost_share:.2g %} of them could be missing, and the gyro's scale factors be wrong by up to as much; their "
        "standard error without that is {sigma_scale:.2g %}.",
        "An effect that S and b lack (a nonlinear gyro); a support that gives way after the moves; a link or a logger "
        "that drops samples and renumbers the others, or timestamps them anew.",
        "See which: `trihedron diagnose LOG`. Where it names no effect, put the sensor on a firm support, log the "
        "count of samples or the time that the sensor itself gives (not one of the logger), and record again.",
    ),
    ("clipping", "moves", WARNING): Words(
        "the gyro clipped in {moves} of {n_moves} moves (move {which:first 8}), for {longest_s:.3g} s at most; "
        "interpolated with less weight: {bridged}, excluded: {left_out}.",
        "the sensor was turned faster than its range limit.",
        "Turn with rates below about half the range limit, or set a wider range.",
    ),
    ("time-gap", "moves", WARNING): Words(
        "samples are missing inside {moves} of {n_moves} moves (move {which:first 8}); their rotation is uncertain and "
        "they weigh less.",
        "the logger lost samples while the sensor moved.",
        "Record again, or log at a rate that the link sustains.",
    ),
    ("static-rate-above-noise", "", WARNING): Words(
        "The gyro rate in static poses changes from pose to pose by {rate_rms_rad_s:.2g °/s} rms and, with each pose "
        "weighted by its uncertainty, {times:.2g} times what noise and the bias drift of the calibration allow; "
        "largest in pose {worst_pose} ({axis:axis} {worst_rad_s:.2g °/s}){is_by_gravity:?. It goes with gravity, by up "
        "to {per_g_rad_s:.2g °/s} per g|}.",
        "{is_by_gravity:?G-sensitivity of the gyro, which S and b cannot correct|The bias drifts in this log more than "
        "in the one that was calibrated (warm-up, temperature)}.",
        "{is_by_gravity:?See whether it is g-sensitivity: `trihedron diagnose LOG`; it is fitted by "
        "`trihedron calibrate LOG --extended -o calibration.json`"
        "|Let the sensor warm up, or estimate the bias in use}.",
        or_severity=SERIOUS,
    ),
    ("held-out-worse", "verify-moves", WARNING): Words(
        "The tilt error after rotations is {angle_rms_deg:.3g}° rms and, with each move weighted by its uncertainty, "
        "{times:.2g} times what noise and uncertainty allow; largest for its uncertainty in move {worst_move} "
        "({worst_deg:.3g}°){is_beside:?, beside the unsteady pose {unsteady:first 2}|}"
        "{is_single:?, without which they are as expected|}.",
        "{is_single:?The gyro clipped, samples were lost, or a pose beside move {worst_move} was not static|"
        "{is_common:?All gyro scales differ by one factor ({common:+.2g %}): the clock or the rate of one of the two "
        "logs is off by it, or the gyro's sensitivity has changed; the log alone does not say which|"
        "{is_bias:?Biases have changed since, scales and axes have not (warm-up, temperature, shock)|{is_few:?In the "
        "file, or in the sensor since, {shifted:ids} changed: nothing else differs from this log's own calibration|"
        "{is_far:?The file is of another sensor, unit or frame, or scales|{is_beside:?A pose beside that move was not "
        "still, or scales|Scales}} and cross-axis terms have changed since{is_far:?|, or the file is of another device}"
        "; else samples were lost or the gyro clipped}}}}.",
        "{is_single:?Look at move {worst_move}; if the poses around it were static, calibrate|{is_common:?Check the "
        "clocks of both logs (--columns time=none --rate HZ states a rate); if they are right, calibrate|{is_bias:?Let "
        "the sensor warm up, then calibrate|{is_few:?Check {shifted:ids} in the file; if right, calibrate|{is_far:?"
        "Check that file, sensor and unit belong together; if they do, calibrate|See what differs: `trihedron diagnose "
        "LOG --calibration FILE`; or calibrate}}}}} again near the conditions of use.",
        or_severity=SERIOUS,
    ),
}

_TURNS = {
    ("turn-not-a-multiple", "left-out", WARNING): Words(
        _WRONG_TURN + "others; it is excluded.",
        _ANOTHER_TURN,
        _CORRECT_OR_REPEAT,
    ),
    ("turn-not-a-multiple", "contradicted", SERIOUS): Words(
        _WRONG_TURN + "others; no third turn shows which of them is wrong.",
        _ANOTHER_TURN,
        _CORRECT_OR_REPEAT,
    ),
    ("turn-not-a-multiple", "scatter", WARNING): Words(
        "the turns scatter by {sigma_turn_rad:.2g deg} about their nominal multiples; the uncertainties include it.",
        "turned by eye, without a wall.",
        "Place the case against a wall before and after each turn.",
    ),
    ("turn-unchecked", "", WARNING): Words(
        "only one turn about {axes:axes and}, which no move checks: a wrong angle would not show.",
        "a wrong angle goes into the scale unnoticed.",
        "Turn there and back at least once about every axis.",
    ),
    ("turn-not-a-multiple", "no-multiple", WARNING): Words(
        "turn {turn} ({at_s:.1f} s) about {axis:axis} is {seen_rad:.1f deg}, far from any multiple of 90°; it is "
        "excluded.",
        "turned without a wall.",
        "Repeat it against a wall, or give its angle.",
    ),
}

ENTRIES = {**_MOVES, **_TURNS}
