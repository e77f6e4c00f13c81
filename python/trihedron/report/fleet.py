"""Report of a fleet of devices."""

import statistics
from collections import Counter
from functools import partial
from shlex import quote

import numpy as np

from trihedron.arrays import BoolArray
from trihedron.records.fleet import FleetLog, FleetSummary
from trihedron.records.sessions import PARAMETERS, Parameter
from trihedron.report.axes import TRIAD
from trihedron.report.chart import AXIS_COLOURS, Chart, Colour, Level, Panel, Points, Scale
from trihedron.report.document import Block, Document, Facts, Paragraph, Picture, Section, Table
from trihedron.report.drawn import said
from trihedron.report.effects.catalogue import experiment
from trihedron.report.names import axis_in_print, finding_in_print, id_in_print, label_of
from trihedron.report.numbers import capital, first_of, how_many, in_mm_s2, listed, plain_number, shown
from trihedron.report.sessions import change_in_words, repeated_cells

VERDICTS = {
    "consistent": "no missing effect is detectable",
    "missing-physics": "physics beyond the linear model",
    "unexplained": "a misfit that no mechanism explains",
    "not-testable": "cannot be tested",
    "parameters-differ": "other parameters",
}


def fleet_report(summary: FleetSummary) -> Document:
    """Lay out the result of every log, differences between devices, and shared effects."""
    n = len(summary.logs)
    bad = [log for log in summary.logs if log.status != "done"]
    n_done = n - len(bad)
    mixed = {one.serial for one in summary.mixed}
    n_devices = how_many(len({log.serial for log in summary.logs}), "device") + (" or more" if mixed else "")
    moved = list(dict.fromkeys(change.group for change in summary.changes if change.significant))
    devices = {log.serial for log in summary.logs if log.status == "done" and log.serial not in mixed}
    sections = [Section("Result", (Facts(_facts(summary)),))]
    if bad:
        reasons = tuple((f"{log.serial}: {log.name}", f"{log.status}: {_reason(log)}") for log in bad)
        sections.append(Section("Logs that were not calibrated", (Facts(reasons),)))
    if summary.n_diagnosed:
        sections.append(Section("Physics that devices share", tuple(_physics(summary))))
    if summary.repeated:
        heading = "How devices differ" if len(devices) > 1 else "How the logs differ"
        sections.append(Section(heading, tuple(_spread(summary))))
    if summary.outliers:
        sections.append(Section("Outliers", tuple(_outliers(summary))))
    if moved:
        sections.append(Section("Drift between sessions of one device", tuple(_drift(summary))))
    n_usable = sum(map(is_usable, summary.logs))
    lead = None
    if n_done:
        caption = "The parameters that differ most beside their uncertainties: a point ± 1 σ for each log, about the "
        caption += "median of devices."
        lead = Picture("differ", caption, partial(fleet_chart, summary))
    sections.append(Section("Every log", (_logs(summary),)))
    verdict = f"{n_usable} of {how_many(n, 'log')} usable{_warned(summary)}, of {n_devices}."
    if n_done == 0:
        verdict = "NONE of the logs could be calibrated; the reasons are below."
    none = {log.serial for log in summary.logs} - {log.serial for log in summary.logs if is_usable(log)}
    if none and n_done:
        verdict += f" Without a usable calibration: {_named(sorted(none))}."
    for one in summary.mixed:
        what, away = _by(one.parameter, one.difference)
        verdict += f" The {how_many(one.n_logs, 'log')} of {one.serial} are of SEVERAL devices"
        verdict += f": {one.odd} differs from the others." if one.odd else "."
        verdict += f" {capital(what)} differs by {away}."
    opened = Counter(log.verdict for log in summary.logs if log.verdict in OPEN)
    if opened:
        found = [f"{VERDICTS[one]} in {how_many(k, 'log')}" for one, k in opened.most_common()]
        named = first_of([id_in_print(effect.id) for effect in summary.effects])
        verdict += f" Diagnosis: {listed(found)}{f' ({named})' if named else ''}."
    outliers = list(dict.fromkeys(one.serial for one in summary.outliers))
    if summary.repeated and len(devices) > 1 and not outliers and not mixed:
        verdict += f" {_within(summary)}"
    if outliers:
        first = summary.outliers[0]
        what, away = _by(first.parameter, first.deviation)
        verdict += f" {_named(outliers)} outside the others (most: {first.serial}, {what} by {away})."
    if moved:
        verdict += f" {_named(moved)} changed between sessions, or the logs are of several units."
    is_doubtful = n_usable < n or opened or outliers or moved
    return Document(
        title="Fleet",
        subtitle=f"{how_many(n, 'log')}, {n_devices}",
        verdict=verdict,
        sections=tuple(sections),
        lead=lead,
        next_step=next_step_of_fleet(summary, outliers, moved),
        stated_level="bad" if mixed or not n_usable else "usable" if is_doubtful else None,
    )


def _warned(summary: FleetSummary) -> str:
    """Usable logs with warnings, by the name of the warning, the commonest first."""
    logs: dict[str, list[str]] = {}
    for log in filter(is_usable, summary.logs):
        for code in log.warned:
            logs.setdefault(code, []).append(called(log, summary))
    said = [
        f"{finding_in_print(code)} in {names[0] if len(names) == 1 else how_many(len(names), 'log')}"
        for code, names in sorted(logs.items(), key=lambda one: -len(one[1]))
    ]
    n = sum(bool(log.warned) for log in filter(is_usable, summary.logs))
    return f" ({n} with warnings: {first_of(said)})" if said else ""


def _named(devices: list[str]) -> str:
    """``3 devices (a, b, c)``; at most ``MOST_NAMED`` names."""
    more = ", ..." if len(devices) > MOST_NAMED else ""
    return f"{how_many(len(devices), 'device')} ({', '.join(devices[:MOST_NAMED])}{more})"


def _reason(log: FleetLog) -> str:
    """Why a log was not calibrated, its command with the path that the sentence begins with."""
    path, colon, rest = log.reason.partition(": ")
    return log.reason.replace(" LOG`", f" {quote(path)}`") if colon and path.endswith(log.name) and rest else log.reason


def _facts(summary: FleetSummary) -> tuple[tuple[str, str], ...]:
    status = Counter(log.status for log in summary.logs)
    doubtful = [log for log in summary.logs if log.status == "done" and not log.is_trustworthy]
    facts = [("calibrated", f"{how_many(status['done'], 'log')} of {len(summary.logs)}")]
    held = [log.held_out_rms_m_s2 for log in summary.logs if is_usable(log) and log.held_out_rms_m_s2 is not None]
    if held:
        sizes = f"median {in_mm_s2(statistics.median(held))}, worst {in_mm_s2(max(held))}"
        facts.append(("gravity error in static poses", f"{sizes}, cross-validated"))
    if doubtful:
        codes = Counter(code for log in doubtful for code in log.serious).most_common()
        why = ", ".join(f"{finding_in_print(code)} ({count})" for code, count in codes)
        facts.append(("not to be trusted", f"{how_many(len(doubtful), 'log')}: {why}"))
    if status["rejected"]:
        facts.append(("not calibrated", f"{how_many(status['rejected'], 'log')}: they do not allow a calibration"))
    if status["crashed"]:
        facts.append(("failed", f"{how_many(status['crashed'], 'log')}: tried again by the next run"))
    if summary.n_compared:
        without = f"; not {summary.passed_over}" if summary.passed_over else ""
        devices = how_many(summary.n_devices_compared, "device")
        facts.append(("compared", f"{how_many(summary.n_compared, 'log')} of {devices}{without}"))
    if summary.n_before:
        facts.append(("from before", f"{how_many(summary.n_before, 'result')} of an earlier run were kept"))
    for verdict, count in Counter(log.verdict for log in summary.logs if log.verdict and is_usable(log)).most_common():
        facts.append((verdict, f"{how_many(count, 'log')}: {VERDICTS.get(verdict, '')}"))
    return tuple(facts)


def _by(parameter: Parameter, difference: float) -> tuple[str, str]:
    """A parameter, and a difference of it."""
    factor, unit = shown(parameter.unit)
    return label_of(parameter.id, parameter.name), f"{plain_number(difference * factor, 2)} {unit}"


def _physics(summary: FleetSummary) -> list[Block]:
    if not summary.effects:
        return [Paragraph(f"No effect beyond the linear model was accepted in {how_many(summary.n_diagnosed, 'log')}.")]
    rows = []
    for effect in summary.effects:
        logs = f"{effect.n_logs} of {summary.n_diagnosed}"
        devices = f"{effect.n_devices} of {summary.n_devices_diagnosed}"
        rows.append((id_in_print(effect.id), logs, devices, f"{100 * effect.low:.0f} to {100 * effect.high:.0f} %"))
    return [Table(("effect", "logs", "devices", "share of devices, 95 %"), tuple(rows), "Effects by device")]


def _spread(summary: FleetSummary) -> list[Block]:
    is_grouped = any(one.between is not None for one in summary.repeated)
    head = ["parameter", "mean ± σ", "device to device" if is_grouped else "from log to log", "95 %"]
    head += ["session to session", "95 %"] if is_grouped else []
    kinds = ("between", "within") if is_grouped else ("within",)
    rows = [tuple(repeated_cells(one, kinds)) for one in summary.repeated]
    said = "Standard deviations beyond each log's uncertainty. Scales are relative to their mean; misalignments are "
    said += f"departures from 90°; {TRIAD}."
    if summary.passed_over:
        said += f" Not counted: {summary.passed_over}."
    return [Paragraph(said), Table(tuple(head), tuple(rows), "Standard deviations between devices and of one device")]


def _within(summary: FleetSummary) -> str:
    """The largest deviation beside the limit, where no device is an outlier."""
    one = summary.farthest
    if one is None:
        return "Whether a device stands out is tested from 4 devices with a usable calibration on."
    what, away = _by(one.parameter, one.deviation)
    return (
        f"No device stands out: the farthest is {one.serial} by {what}, {away} or {plain_number(one.sigmas, 2)} σ of "
        f"the others, p {plain_number(one.p_adjusted, 2)} over all devices and parameters (limit 0.01)."
    )


def _outliers(summary: FleetSummary) -> list[Block]:
    rows = [
        (
            one.serial,
            *_by(one.parameter, one.deviation),
            plain_number(one.sigmas, 2),
            plain_number(one.p_adjusted, 1),
            files_of(one.serial, summary),
        )
        for one in summary.outliers
    ]
    head = ("device", "parameter", "from the median", "in spreads of the others", "p", "logs")
    return [Table(head, tuple(rows), "Outliers")]


def _drift(summary: FleetSummary) -> list[Block]:
    moved = [change for change in summary.changes if change.significant]
    n_devices = len({change.group for change in summary.changes})
    tested = f"{how_many(n_devices, 'device')} with two compared logs or more, seven groups of parameters each, 1 % "
    tested += "over all."
    rows = []
    for change in moved:
        how, sizes, unit = change_in_words(change)
        k = max(range(len(change.size)), key=lambda i: abs(change.size[i]))
        size = f"{sizes[k]} {unit} in {axis_in_print(change.names[k])}"
        rows.append((change.group, id_in_print(change.id), how, size, plain_number(change.p_adjusted, 1)))
    head = ("device", "parameter", "how", "by", "p")
    whole = f"Tested: {tested} A folder is taken for one device unless --serial names it ({BY_FILE})."
    return [Paragraph(whole), Table(head, tuple(rows), "Changes between sessions")]


def _logs(summary: FleetSummary) -> Table:
    rows = tuple(
        (
            log.name,
            log.serial,
            log.status if log.is_trustworthy or log.status != "done" else "done, not to be trusted",
            log.verdict or "–",
            ", ".join(map(id_in_print, log.effects)) or "–",
            ", ".join(map(finding_in_print, (*log.serious, *log.warned))) or "–",
            "–" if log.n_poses is None else str(log.n_poses),
            "–" if log.held_out_rms_m_s2 is None else plain_number(log.held_out_rms_m_s2 * shown("m/s^2")[0], 2),
        )
        for log in summary.logs
    )
    head = ("log", "device", "status", "verdict", "effects", "findings", "poses", "cross-validated [mm/s²]")
    return Table(head, rows, "What became of every log")


def fleet_chart(summary: FleetSummary) -> Chart:
    """A panel for each of the parameters in which devices differ most relative to their standard errors: one point
    ± 1 σ for each log, about the median."""
    logs = [log for log in summary.logs if log.numbers is not None and log.std is not None]
    # One calibration that is not to be trusted would set the scale of all.
    logs = [log for log in logs if log.is_trustworthy] or logs
    n = min((len(log.numbers) for log in logs if log.numbers is not None), default=0)
    serials = list(dict.fromkeys(log.serial for log in logs))
    outliers = {(one.serial, one.parameter) for one in summary.outliers}
    serial_of = np.array([serials.index(log.serial) for log in logs])
    order = np.array([int(np.sum(serial_of[:k] == serial_of[k])) for k in range(len(logs))])
    count = np.bincount(serial_of, minlength=len(serials))[serial_of]
    across = 1.0 + serial_of + 0.5 * ((order + 0.5) / count - 0.5)
    numbers = np.array([log.numbers[:n] for log in logs if log.numbers is not None])
    errors = np.array([log.std[:n] for log in logs if log.std is not None])
    x = Scale("device, in the order of the table", whole=True, limits=(0.5, len(serials) + 0.5), names=tuple(serials))
    called = [f"{log.serial}: {log.name}" for log in logs]
    good = np.array([log.is_trustworthy for log in logs], dtype=bool)
    panels = []
    apart = numbers - np.median(numbers, axis=0)
    strength = np.sum((apart / np.where(errors > 0.0, errors, np.inf)) ** 2, axis=0)
    for k in sorted(np.argsort(-strength)[:MOST_NAMED].tolist()):
        parameter = PARAMETERS[k]
        factor, unit = shown(parameter.unit)
        centre = float(np.median([numbers[serial_of == s, k].mean() for s in range(len(serials))]))
        values, error = (numbers[:, k] - centre) * factor, errors[:, k] * factor
        is_outlier = good & np.array([(log.serial, parameter) in outliers for log in logs])
        marks: list[Level | Points] = [Level(y=0.0)]
        kinds: tuple[tuple[BoolArray, Colour, str], ...] = (
            (good & ~is_outlier, AXIS_COLOURS[0], "a log"),
            (is_outlier, "accent", "unlike the others"),
            (~good, "soft", "not to be trusted"),
        )
        for part, colour, name in kinds:
            if part.any():
                tips = [said(called[i], values[i], f"± {error[i]:.2g} {unit}") for i in np.flatnonzero(part)]
                marks.append(Points(across[part], values[part], tips, error[part], name, colour))
        y = Scale(f"{label_of(parameter.id, parameter.name)}  [{unit}]", unit)
        panels.append(Panel(x, y, tuple(marks), height_px=150))
    return Chart(tuple(panels), columns=2)


# The next action for a fleet: logs to record again, devices to check, effects to look at.

MOST_NAMED = 4
"""Most devices or logs in a sentence, and most parameters in the first picture."""
BY_FILE = "`--serial '([^/]+)$' -o NEW_FOLDER`: one unit a file"
RATE_ASSUMED = "rate-assumed"
OPEN = ("missing-physics", "unexplained")
"""Verdicts with effects or residuals that the calibration does not include."""


def next_step_of_fleet(summary: FleetSummary, outliers: list[str], moved: list[str]) -> str:
    usable = [log for log in summary.logs if is_usable(log)]
    unusable = [log for log in summary.logs if not is_usable(log)]
    rates = [called(log, summary) for log in unusable if RATE_ASSUMED in log.serious]
    unusable = [log for log in unusable if RATE_ASSUMED not in log.serious]
    again = [f"{called(log, summary)}{_why(log)}" for log in unusable if not log.reread]
    opened = [called(log, summary) for log in usable if log.verdict in OPEN]
    mixed = [one.serial for one in summary.mixed]
    # One device a file separates all folders, also those of one device.
    counts = Counter(log.serial for log in summary.logs)
    several = {*moved, *(one.serial for one in summary.mixed)}
    by_file = f" ({BY_FILE})" if all(n == 1 or name in several for name, n in counts.items()) else ""
    steps = [f"give each device of {first_of(mixed)} a folder of its own{by_file}"] if mixed else []
    steps += [f"if {first_of(moved)} contains several units, give each a folder{by_file}"] if moved else []
    for action in dict.fromkeys(log.reread for log in unusable if log.reread):
        names = first_of([called(log, summary) for log in unusable if log.reread == action])
        steps += [f"for {names}, by `trihedron calibrate`: {action[:1].lower()}{action[1:].rstrip('.')}"]
    steps += [f"give --rate for {first_of(rates)}"] if rates else []
    steps += [f"record again, if it was to be a calibration: {first_of(again)}"] if again else []
    odd = [f"{one} ({files_of(one, summary)})" for one in outliers]
    steps += [f"check part, mounting and units of {first_of(odd)}"] if odd else []
    steps += [f"see what effects gain in {first_of(opened)}: `trihedron diagnose` each"] if opened else []
    steps += [f"against {id_in_print(one)}: {said}" for one, said in _remedy(summary)]
    steps += ["use each device's own calibration (folder calibrations)"] if usable else []
    return " ".join(f"{capital(step)}." for step in steps)


def _remedy(summary: FleetSummary) -> list[tuple[str, str]]:
    """The commonest effect with what to record against it, where most devices have it."""
    common = [one for one in summary.effects[:1] if 2 * one.n_devices > summary.n_devices_diagnosed]
    return [(one.id, said) for one in common if (said := experiment(one.id))]


def files_of(serial: str, summary: FleetSummary) -> str:
    """The usable logs of a device."""
    return first_of([log.name for log in summary.logs if log.serial == serial and is_usable(log)])


def is_usable(log: FleetLog) -> bool:
    return log.status == "done" and log.is_trustworthy


def called(log: FleetLog, summary: FleetSummary) -> str:
    """The name of a log, with its device where several have that name."""
    is_alone = sum(one.name == log.name for one in summary.logs) == 1
    return log.name if is_alone else f"{log.serial}: {log.name}"


def _why(log: FleetLog) -> str:
    why = finding_in_print(log.serious[0]) if log.serious else "not calibrated"
    return f" ({why})"
