"""Findings about time: timestamps, rates, gaps, and the clock of a recording."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_INTEGRATED = "Turns that fall into a gap are interpolated and weigh less; repeat them."

_TIMESTAMPS = {
    ("time-jitter", "", NOTE): Words(
        "Intervals between timestamps are {least_s:.3g !ms} to {largest_s:.3g ms} (median {median_step_s:.5g ms}, mean "
        "{mean_step_s:.5g ms}){is_irregular:?, {jitter_s:.3g ms} rms about their mean; no even clock lies behind "
        "them|}; the rate used is {rate_hz:.5g} Hz.",
        "{is_irregular:?A program that samples in its own time: its timestamps were kept.|Timestamps taken when the "
        "data arrived, or rounded.}",
        "Take timestamps in the sensor's own interrupt if turns matter.",
        or_severity=WARNING,
    ),
    ("time-duplicate", "", WARNING): Words(
        "{count} samples ({fraction:.3g %}) have the same time as the one before (first: {where}).",
        "Several samples with one timestamp, timestamps of too few digits, or rows written twice.",
        "{is_mended:?|With samples timestamped in batches, read with --columns time=none and --rate.}",
        or_severity=NOTE,
    ),
    ("time-gap", "static", NOTE): Words(
        "{count:# gap}, about {lost_samples:# sample} lost ({fraction:.2g %}); the longest lasts {longest_s:.4g} s.",
        "Lost packets, a full buffer, or a pause of the logger.",
        "The noise terms allow for what is missing: nothing needs to be done.",
    ),
    ("time-gap", "", WARNING): Words(
        "{count:# gap}, about {lost_samples:# sample} lost ({fraction:.2g %}); the longest lasts {longest_s:.4g} s. "
        "Where: {worst:each; }{has_more:?; and others|}.",
        "Lost packets, a full buffer, or a pause of the logger.",
        _INTEGRATED,
        or_severity=SERIOUS,
        lines={"worst": "{v0:.4g} s before {v1}"},
    ),
    ("time-wrapped", "", NOTE): Words(
        "The clock starts again from 0 at {modulus:.12g}, {count} times (first: {where}); the time was continued.",
    ),
    ("time-backward", "", WARNING): Words(
        "Time runs backward at {count} places (first: {where}); the rows were sorted by time, none moved further than "
        "{displaced_rows} rows.",
        "Packets that overtook each other.",
        "If the rows stand in the right order and the timestamps are wrong, read with --columns time=none and --rate.",
    ),
    ("time-backward", "set", WARNING): Words(
        "The clock was set back at {count:# place} (first: {where}; by up to {largest:.4g} in its own unit); the rows "
        "keep their order, and the time continues there by one interval.",
        "A clock that was synchronised while the log ran.",
        "Take the timestamps from a clock that is never set (monotonic).",
    ),
    ("non-finite", "time", WARNING): Words(
        "{count} rows have no time (first: {where}) and were excluded.",
        "Damaged rows.",
        "Check the logger.",
    ),
    ("time-unit-detected", "", NOTE): Words(
        "The time column is in {unit:unit}, by its median interval of {step:.6g}{has_others:?; {others:&, } would be "
        "possible too|}.",
    ),
    ("time-unit-detected", "unsure", WARNING): Words(
        "The unit of the time column is uncertain: taken as {unit:unit}, its median interval of {step:.6g} makes "
        "{rate_hz:.4g} Hz{has_others:?; {others:&, } would be possible too|}.",
        "The interval alone does not determine the unit; every rate and every noise density depends on it.",
        "Confirm that the time column is in {unit:unit}, which makes {rate_hz:.4g} Hz, or correct it: --time-unit s, "
        "ms, us or ns; --rate HZ if the column counts rows.",
    ),
    ("rate-contradicted", "time-unit", SERIOUS): Words(
        "Read in {unit:unit} as given, the time column makes {rows:# row} in {span_s:.3g} s, {rate_hz:.6g} Hz"
        "{is_named:?, though its name says {named:unit}|}.",
        "A wrong --time-unit.",
        "Drop --time-unit, or give the unit in which the rate is that of the sensor.",
    ),
    ("time-unit-detected", "sample-time", NOTE): Words(
        "SampleTimeFine increases by {step:.6g}, so it counts {is_us:?microseconds, as Movella DOT does|100 µs, as "
        "Xsens MTi does}.",
        action="Give --time-unit if this is wrong.",
    ),
    ("time-unit-detected", "other-clocks", NOTE): Words(
        "The name of the time column {column} says {named:unit}, but {count} other clocks of the log agree that it is "
        "in {unit:unit}, in which it was read.",
        "A program that names a clock of its device in the unit of its own.",
        "If the name is right, give --time-unit {named}.",
    ),
    ("time-unit-detected", "sum-of-steps", NOTE): Words(
        "Column {column} contains the time since the row before; the time is their sum.",
        action="If it is something else, read with --columns time=none and --rate.",
    ),
}

_RATES = {
    ("clock-jumped", "", SERIOUS): Words(
        "The clock's rate changes by {percent:.2g} % {where}, and gravity {decided:?turns as if it had "
        "not|does not show which part is right}.",
        "A clock that was set or switched in the middle of the log.",
        "Split the log there and calibrate the parts one by one: gyro scale is inversely proportional to the rate.",
    ),
    ("rate-contradicted", "", WARNING): Words(
        "The rate was given as {given_hz:.6g} Hz but the time column runs at {clock_hz:.6g} Hz; the column was used.",
        "A nominal rate, or a clock that is wrong.",
        "To use the given rate, read with `--columns time=none --rate {given_hz:.6g}`.",
    ),
    ("rate-stated", "", NOTE): Words(
        "No time column; the rate is {rate_hz:.6g} Hz {is_given:?as given|as the file states above its data or "
        "beside them}."
    ),
    ("rate-assumed", "", WARNING): Words(
        "The log has no time column and no rate; {rate_hz:g} Hz was assumed.",
        "Only readings were logged.",
        "Give --rate HZ{has_gyro:?: gyro scale, times and noise densities depend on it; 1 % of rate is 1 % of gyro "
        "scale|}.",
        or_severity=SERIOUS,
    ),
}

_TIMESTAMPS_OF = "{is_of_one:?The {sensor}'s|The} timestamps"
_EVEN = "of {rate_hz:.5g} Hz"
_HOW = (
    "{is_rounded:?rounded to {grid_s:.3g ms}|{is_late:?late by {timestamp_error_s:.2g ms} rms, as they are when "
    "samples are timestamped on arrival|scattered by {timestamp_error_s:.2g ms} rms}}"
)
_BY_MOTION = (
    "{motion_shows:?the readings in motion contain {followed:± sigma_followed %} of that error "
    "(0 %: sampled evenly, 100 %: sampled at the timestamps)|no motion shows when samples were taken}"
)
_LOG_COUNTER = "Log the sensor's own sample counter or data-ready times if turns matter."

_CLOCKS = {
    ("even-clock", "", NOTE): Words(
        f"{_TIMESTAMPS_OF} are {_HOW} about an even clock {_EVEN}, which was used: {_BY_MOTION}."
    ),
    ("timestamps-kept", "", NOTE): Words(
        f"{_TIMESTAMPS_OF} differ from an even clock {_EVEN} by {{timestamp_error_s:.2g ms}} rms, {_BY_MOTION}: kept.",
    ),
    ("clock-undecided", "", WARNING): Words(
        f"{_TIMESTAMPS_OF} are {_HOW} about an even clock {_EVEN} and {_BY_MOTION}: {{is_partly:?both partly right, |}}"
        "the timestamps were kept.",
        "{is_partly:?Samples taken unevenly and timestamped inexactly.|A sensor that is sampled evenly and timestamped "
        "on arrival, or one that is sampled unevenly.}",
        _LOG_COUNTER,
    ),
    ("clocks-merged", "same-timestamps", NOTE): Words("Both sensors have the same timestamps."),
    ("clocks-merged", "", NOTE): Words(
        "Two clocks merged: accelerometer {accelerometer_rate_hz:.5g} Hz, gyro {gyroscope_rate_hz:.5g} Hz, gyro starts "
        "{offset_s:+.3f ms} after; the {base} keeps its samples, the {other} was taken at the same tick in "
        "{same_tick_fraction:.3g %} of rows and interpolated between neighbours elsewhere, which leaves "
        "{variance_factor:.3g %} of its white-noise variance; outside the overlap {rows_left_out:# row} cut"
        "{has_lost:?, in gaps of the {other} {lost_rows:# row} without its reading|}.",
        "Each sensor was logged with its own timestamps.",
        "{is_resampled:?For the {other}'s noise (Allan variance) read its file alone, where nothing is interpolated.|}",
        or_severity=WARNING,
    ),
}

ENTRIES = {**_TIMESTAMPS, **_RATES, **_CLOCKS}
