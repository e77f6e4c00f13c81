"""Findings about the readings: missing, repeated, frozen, clipped, coarse."""

from trihedron.report.findings.entry import SERIOUS, WARNING, Words

ENTRIES = {
    ("devices-interleaved", "", SERIOUS): Words(
        "Rows alternate between the readings of {n} devices, and no column identifies them.",
        "Several sensors written into one log, row by row.",
        "Read with --instance 1 to {n}, in the order of the rows; or log whose row it is, and name the column with "
        "--columns device=COLUMN.",
    ),
    ("axes-changed", "", SERIOUS): Words(
        "The axes of the {sensor} change about {where} ({from_s:.1f} s to {to_s:.1f} s): from then on "
        "{axes:each}{is_scaled:?, times {ratio:.3g}|}.",
        "A reset of the sensor or its driver with other settings, or a sensor mounted anew"
        "{has_others:?. Or it is the {other}: {others:each}|}.",
        "Split the log there, and calibrate the parts one by one.",
        lines=dict.fromkeys(("axes", "others"), "{v0:axis} reads what {v1:?−|}{v2:axis} read"),
    ),
    ("axes-changed", "range", SERIOUS): Words(
        "The scale of the {sensor} changes about {where} ({from_s:.1f} s to {to_s:.1f} s): from then on "
        "it reads {ratio:.3g} times as much.",
        "A reset of the sensor or its driver, with another range or unit.",
        "Split the log there, and calibrate the parts one by one; or multiply the later readings by {inverse:.6g}.",
    ),
    ("axes-changed", "leap", SERIOUS): Words(
        "Gravity leaps from one sample to the next without as much rotation of the gyro (first: {where}; {count} in "
        "all).",
        "Rows were lost there without a gap in time, or the axes of both sensors were turned.",
        "Record again; or split the log there, and calibrate each part that has poses enough.",
    ),
    ("non-finite", "readings", WARNING): Words(
        "The {sensor} has {count} rows without a finite reading (first: {where}).",
        "Lost samples, or a logger that writes NaN.",
        "These rows are excluded; nothing is made up in their place.",
        or_severity=SERIOUS,
    ),
    ("repeated-rows", "", WARNING): Words(
        "The {sensor} repeats its last reading in {count} rows ({fraction:.3g %}; chance would give {chance:.2g %}); "
        "the longest run is {longest_run} rows from {where}.",
        "The log is faster than this sensor, or the logger repeats a value when it has no new one.",
        "A repeated reading is late by up to the length of its run; log at the sensor's own rate.",
    ),
    ("invalid-readings", "isolated", WARNING): Words(
        "{count:# single reading} {count:?leaps|leap} away from both neighbours, on one axis alone or with one value "
        "on all ({counts:each}; first: {where}).",
        "Errors of the bus or of the logger: motion and shocks move all axes.",
        "These rows are excluded; shorten the cable or lower the bus clock before the next log.",
        or_severity=SERIOUS,
        lines={"counts": "{v0} {v1}"},
    ),
    ("invalid-readings", "wrapped", WARNING): Words(
        "{count:# reading} {count:?comes|come} out at the opposite range limit ({counts:each}; first: {where}).",
        "Readings beyond the range of their integers, which overflow.",
        "These rows are excluded; choose a larger range of the sensor, or a wider integer in the logger.",
        or_severity=SERIOUS,
        lines={"counts": "{v0} {v1}"},
    ),
    ("invalid-readings", "copied", WARNING): Words(
        "{count:# reading} {count:?repeats|repeat} earlier ones in blocks, each a different one and under a new "
        "timestamp ({counts:each}; first: {where}).",
        "A buffer that was sent or written twice, in place of other samples or beside them.",
        "These rows are excluded; repair the transfer (DMA, FIFO) before the next log.",
        or_severity=SERIOUS,
        lines={"counts": "{v0} {v1}"},
    ),
    ("stuck-values", "", WARNING): Words(
        "{sensor} {is_triad:?repeats all axes|{axis_name:axis} stays at {value:.7g}} for {longest_run} samples from "
        "{where}, far longer than chance ({count} in all).",
        "A frozen channel, or a bus that answers with an old value.",
        "{is_excluded:?These rows are excluded; repair|Repair} the channel before the next log.",
        or_severity=SERIOUS,
    ),
    ("stuck-values", "motionless", SERIOUS): Words(
        "{sensor} {axis_name:axis} does not follow the motion: it reads only noise while {sensor} readings of the "
        "other axes, and gravity, turn.",
        "A dead channel, or a column that is not this axis.",
        "Name its column with --columns, or repair the channel and log again{has_others:?; the accelerometer alone: "
        "--columns {mapping}|}.",
    ),
    ("coarse-resolution", "", WARNING): Words(
        "The {sensor}'s resolution is coarser than its noise ({axes:each}, raw units).",
        "Few bits, or values rounded when they were written.",
        "Averaging longer does not help where the noise does not move the last digit; choose a smaller range.",
        lines={"axes": "{v0:axis}: LSB {v1:.4g}, noise {v2:.2g}"},
    ),
    ("clipping", "", WARNING): Words(
        "The {sensor} {is_static:?reads its range limit while static|is clipped}: {limits:each}; first at {where}.",
        "{is_static:?The range ends below {is_gyro:?the bias|1 g plus the bias} of that axis, or the channel is stuck|"
        "The motion left the measuring range}.",
        "{is_static:?If the axis keeps that value in {is_gyro:?motion|other poses} too, it is stuck: check the sensor "
        "and its wiring; else set a wider range|{is_gyro:?Turn with rates below about half the range limit, or set a "
        "wider range; angles integrated over clipped moves are too small|Move more gently, or set a wider range}}.",
        lines={"limits": "{v0:axis} at {v1:.7g} ({v2} samples in {v3:# interval})"},
    ),
    ("temperature-implausible", "", WARNING): Words(
        "Column {column} has {count:# temperature} from {low:.5g} to {high:.5g}, which no sensor has in °C (first: "
        "{where}).",
        "{is_column:?Another unit (K, °F, tenths, counts), or another quantity|A thermometer that was not answering}.",
        "{is_column:?The column is not used: write it in °C, or name its unit (temperature [K], temperature "
        "[°F])|These readings are left out}.",
    ),
}
