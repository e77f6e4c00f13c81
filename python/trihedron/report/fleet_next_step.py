"""The next action for a fleet: logs to record again, devices to check, effects to look at."""

from collections import Counter

from trihedron.records.fleet import FleetLog, FleetSummary
from trihedron.report.effects.catalogue import experiment
from trihedron.report.names import finding_in_print, id_in_print
from trihedron.report.numbers import capital, first_of

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
