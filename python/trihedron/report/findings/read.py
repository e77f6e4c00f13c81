"""Findings about a file: its columns, units, rows and devices."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_SAY_ACCEL_UNIT = "Give --accel-unit m/s^2, g, mg, ..., or counts, if this is wrong."
_SAY_GYRO_UNIT = "Give --gyro-unit rad/s, deg/s, ..., or counts, if this is wrong."
_SOURCE = "{is_given:?as given|by its column names}"
_TURNING = (
    "between poses gravity rotates by {factor:.3g} (± {percent:.1g} %) times the integral of the gyro in {unit:unit} "
    "(1 where the unit is right; correlation {correlation:.2f})"
)
_CLOCK = "with `--columns time=none --rate {right_hz:.3g}`"
_INTEGRATED = "Turns that fall into a gap are integrated wrongly; repeat them."
_CUT_OFF = "A log that was cut off, or a memory card with errors."
_COPY_AGAIN = "Copy it again from the vehicle; gaps in time show where readings are missing."

_UNITS = {
    ("unit-assumed", "alike", WARNING): Words(
        "The accelerometer reads {is_whole:?whole numbers of length |}{static_norm:.4g} while static: {is_whole:?"
        "counts of about 1/1000 g, or mg|mg (1000) or cm/s² (981)}; taken as {unit:unit}.",
        "Both look alike. The calibration differs only in its name of the raw unit.",
        _SAY_ACCEL_UNIT,
    ),
    ("unit-detected", "accelerometer-counts", NOTE): Words(
        "The accelerometer's readings are whole numbers and were taken as counts."
    ),
    ("unit-detected", "accelerometer-static", NOTE): Words(
        "The accelerometer reads {static_norm:.4g} while static, so its unit is {unit:unit}."
    ),
    ("unit-assumed", "no-gravity", WARNING): Words(
        "The accelerometer {is_seen:?reads {static_norm:.4g} in its quietest intervals, which is gravity in no known "
        "unit|has no interval without missing readings to determine its unit}; taken as raw counts.",
        "A raw reading of unknown scale, a log without static poses, or wrong columns.",
        _SAY_ACCEL_UNIT,
    ),
    ("sensors-exchanged", "", SERIOUS): Words(
        "Accelerometer and gyro are exchanged: gravity is in the columns named gyro, and turns by the rates in those "
        "named accelerometer.",
        "A header in another order than the data.",
        "{is_one_file:?Read it with --columns {mapping}.|Give the file of --gyro as --accel and that of --accel as "
        "--gyro.}",
    ),
    ("gravity-missing", "", SERIOUS): Words(
        "The accelerometer reads only {static_norm:.3g} while static: gravity is missing from it.",
        "'Linear' or 'user' acceleration of a phone, from which gravity was subtracted, or wrong columns.",
        "Log the accelerometer itself, or add the gravity that the program logs beside it; nothing can be calibrated "
        "without gravity.",
    ),
    ("unit-contradicted", "accelerometer", SERIOUS): Words(
        f"The accelerometer is in {{unit:unit}} {_SOURCE}, but while static it reads {{static_norm:.4g}} "
        "{unit:unit}, {gravities:.3g} times gravity.",
        "A wrong unit, wrong columns, or a log without static poses.",
        "{has_fitting:?Read it with --accel-unit {fitting}, in which it is gravity|Read it with --accel-unit counts, "
        "as it is gravity in no known unit; or correct --columns}.",
    ),
    ("unit-detected", "stated", NOTE): Words(f"The {{sensor}} is in {{unit:unit}} {_SOURCE}."),
    ("unit-contradicted", "gyro-by-turning", SERIOUS): Words(
        f"The gyro is in {{unit:unit}} {_SOURCE}, but {_TURNING}.",
        "A wrong unit; or, if the unit is right, each time interval lasts {factor:.3g} times as long as it was read.",
        f"{{has_fitting:?Read it with --gyro-unit {{fitting}}; or|Check the clock:}} {_CLOCK} the unit is right.",
    ),
    ("unit-contradicted", "gyro-no-unit", SERIOUS): Words(
        f"No known gyro unit fits: {_TURNING}.",
        "A time base or rate that is wrong by that factor, or a gyro in counts or a unit of its own.",
        f"Check the clock: {_CLOCK} the gyro is in {{unit:unit}}; if the clock is right, state the gyro's unit "
        "(--gyro-unit, counts if it has none).",
    ),
    ("unit-detected", "gyro-counts", NOTE): Words("The gyro's readings are whole numbers and were taken as counts."),
    ("unit-detected", "gyro-by-turning", NOTE): Words(f"The gyro's unit is {{unit:unit}}: {_TURNING}."),
    ("unit-assumed", "gyro", WARNING): Words(
        "Nothing states the gyro's unit; it reads {static:.3g} while static and {largest:.4g} at most, so it was taken "
        "as {unit:unit}.",
        "No unit in the header, and no turns between static poses to determine it.",
        _SAY_GYRO_UNIT,
    ),
}

_WHY_FIRST = {
    "poses": "its quiet readings differ from pose to pose",
    "level": "its steady reading stands far above its noise, as gravity does",
}
_WHY_UNKNOWN = {"short": "the log is too short", "alike": "both triads look alike"}
_NAME_THEM = "If the columns are right, confirm them with --columns {mapping}; else give their order."
_COLUMNS = {
    ("corrected-on-board", "", NOTE): Words(
        "{autopilot} had corrected these readings (accelerometer {accel:.0f}, gyro {gyro:.0f}) by its own offsets and "
        "scales{is_turned:? and turned them into the board's axes|} before it logged them: a calibration finds the "
        "remaining errors.",
        "{has_changed:?Parameters changed while readings were logged: {changed:&, }.|A flight controller logs what it "
        "flies by.}",
        "`trihedron export` composes the parameters that the log states with what the calibration finds; load its file "
        "as a whole.",
        or_severity=WARNING,
    ),
    ("columns-recognised", "", NOTE): Words(
        "Columns{has_file:? of {file}|}: {roles:each}{has_others:?; not used: {others:& }|}.",
        lines={"roles": "{v0} from {v1}"},
    ),
    ("columns-assumed", "accelerometer", WARNING): Words(
        "The {n_columns} columns {is_named:?x y z do not say which sensor they are|have no names}; they were taken as "
        "an accelerometer.",
        "A log without a header; where its poses all read the same, one of a gyroscope.",
        "Name them with --columns, for example --columns time=1,ax=2,ay=3,az=4; a gyro's log goes with --gyro, beside "
        "--accel.",
        or_severity=SERIOUS,
    ),
    ("columns-assumed", "force", WARNING): Words(
        "Columns {taken} have the length of gravity in every pose, so they are no gyro"
        "{is_accelerometer:?: they were taken as the accelerometer|, and were not read}.",
        "Their letter stands for a force in g.",
        "If they are a gyro, name all columns with --columns, as in time=1,gx=2,gy=3,gz=4.",
    ),
    ("columns-assumed", "one-of-several", WARNING): Words(
        "More than one triad could be the {sensor}: {taken} was taken, {others:&; } not used.",
        "The log contains raw and corrected readings, or several devices.",
        "If {taken} are not the uncorrected readings of the sensor, give --columns, which names all to read: "
        "{mapping}.",
    ),
    ("columns-assumed", "unnamed-gyro", WARNING): Words(
        "No gyro was recognised, but columns {taken} turn as gravity turns in the accelerometer's axes.",
        "A gyro under a name that does not say so.",
        "If these are a gyro, read with --columns {mapping}.",
    ),
    ("columns-assumed", "by-values", WARNING): Words(
        "{n_columns} columns have no names; they were taken as {mapping}: the accelerometer's length while static is "
        "gravity{has_gyro:?, and it turns by the gyro's rates|; no columns turn as it does, so none are a gyro}.",
        "A log without a header.",
        "Check the order, and confirm it with --columns {mapping}.",
    ),
    ("columns-assumed", "header-ignored", WARNING): Words(
        "The line '{line}' above the numbers does not name their {n_columns} columns, so it was skipped.",
        "A header with another number of names than there are columns.",
        "Name the columns with --columns.",
    ),
    ("columns-assumed", "commands", NOTE): Words(
        "Its {n_rows} rows are seconds apart, so each rate was taken as constant until the next row.",
        "Commands of a rate table.",
    ),
    **{
        ("columns-assumed", f"six-{why}-accelerometer", NOTE): Words(
            f"Six columns without names: the first three are the accelerometer, because {words}.",
            "A log without a header.",
            _NAME_THEM,
        )
        for why, words in _WHY_FIRST.items()
    },
    **{
        ("columns-assumed", f"six-{why}-gyro", WARNING): Words(
            "Six columns without names: the first three are the gyro, the last three the accelerometer, because "
            f"{words}.",
            "A log without a header.",
            _NAME_THEM,
        )
        for why, words in _WHY_FIRST.items()
    },
    **{
        ("columns-assumed", f"six-{why}", SERIOUS): Words(
            f"Six columns without names were taken as ax ay az gx gy gz, but {words}.",
            "A log without a header.",
            _NAME_THEM,
        )
        for why, words in _WHY_UNKNOWN.items()
    },
    ("column-left-out", "words", NOTE): Words("Column {column} contains words (such as {example!r}) and was excluded."),
    ("column-left-out", "axis", WARNING): Words(
        "Column {column} contains no numbers (such as {example!r}), so the {sensor} was not read.",
        "A damaged column, or a name that it does not belong to.",
        "Correct the column, or name the sensor's columns with --columns.",
    ),
}

_ROWS = {
    ("rows-left-out", "above", WARNING): Words(
        "{rows_left_out} lines above the first row of {n_columns} numbers were skipped (first: line {line}).",
        "Rows of another layout, damaged rows, or numbers that belong to a preamble.",
        "Look at these lines; nothing else of the file was excluded.",
    ),
    ("rows-left-out", "remarks", NOTE): Words(
        "{rows_left_out} lines between the rows begin like remarks and were skipped (first: line {line}).",
        "Remarks of the logger, or rows that somebody took out.",
    ),
    ("line-incomplete", "", NOTE): Words(
        "The last line ({line}) breaks off in the middle and was excluded.",
        "The logger was stopped while it wrote.",
        "Nothing is lost but one sample.",
        or_severity=WARNING,
    ),
    ("rows-unaccounted", "", SERIOUS): Words(
        "The file contains {in_file} rows, {read} were read and {reported} reported as excluded: {count} are not "
        "accounted for.",
        "A fault of the reader.",
        "Report it with the file; until then convert the log to CSV with another program.",
    ),
    ("repeated-rows", "copies", WARNING): Words(
        "{rows_left_out} rows are copies of the row before, timestamp included (first: {where}); they were excluded.",
        "A logger that writes a row twice, or a stream joined with itself.",
    ),
    ("repeated-rows", "read-again", NOTE): Words(
        "{rows_left_out} rows ({share:.3g %}) repeat all readings of the row before (first: {where}); they are no "
        "samples and were excluded.",
        "A program that reads the sensor more often than it measures.",
        "Wait for the data-ready signal of the sensor: a polled reading is late by up to the time between two rows.",
    ),
    ("samples-lost", "bytes-skipped", WARNING): Words(
        "{bytes} bytes at {count} places of the log are damaged and were skipped, readings among them.",
        _CUT_OFF,
        _COPY_AGAIN,
    ),
    ("samples-lost", "damaged", WARNING): Words(
        "The log is damaged inside; what could not be read of it was skipped, readings among it.", _CUT_OFF, _COPY_AGAIN
    ),
    ("samples-lost", "dropouts", WARNING): Words(
        "The logger itself reports {count:# dropout}, {lost_s:.3g} s in all.",
        "A memory card that was too slow.",
        _INTEGRATED,
    ),
    ("samples-lost", "counter", WARNING): Words(
        "The counter {column} skips at {count} places, {wraps:?at least |}{lost_samples} samples are missing (first: "
        "{where}){wraps:?; it starts again from 0, and whole rounds leave no trace|}.",
        "Lost packets.",
        _INTEGRATED,
        or_severity=SERIOUS,
    ),
}

_DEVICES = {
    ("device-chosen", "", NOTE): Words("{where} offers {listed}; {chosen} was read."),
    ("device-chosen", "archive", NOTE): Words(
        "Of the archive {members:& and } {n_members:?was|were} read; not read: {others:first 12}."
    ),
    ("device-chosen", "records", NOTE): Words(
        "Each line names its record: {kinds:each}; those of the accelerometer and the gyro were read.",
        lines={"kinds": "{v0} ({v1})"},
    ),
    ("device-chosen", "in-turn", NOTE): Words(
        "{accelerometer_rows} rows have the accelerometer and {gyroscope_rows} the gyro, with the other's cells empty: "
        "they were read as two logs and joined on their timestamps.",
    ),
}

ENTRIES = {**_UNITS, **_COLUMNS, **_ROWS, **_DEVICES}
