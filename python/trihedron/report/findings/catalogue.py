"""The closed catalogue of findings: every sentence about a recording, by code and case."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from trihedron.records.finding import Severity
from trihedron.report.findings import (
    accelerometer,
    api,
    clock,
    filter_noise,
    gyroscope,
    kalman,
    noise,
    read,
    readings,
    reference,
    segment,
    verify,
)
from trihedron.report.findings.entry import Entry
from trihedron.report.findings.wording import filled

STAGES = (
    *(read, clock, readings, accelerometer, gyroscope, kalman, noise),
    *(api, filter_noise, reference, segment, verify),
)
ENTRIES: tuple[Entry, ...] = tuple(
    Entry(code=code, case=case, severity=severity, **vars(words))
    for stage in STAGES
    for (code, case, severity), words in stage.ENTRIES.items()
)
CATALOGUE: Mapping[tuple[str, str], Entry] = MappingProxyType({(entry.code, entry.case): entry for entry in ENTRIES})


def words_of(
    code: str, case: str, severity: Severity | None, values: Mapping[str, Any]
) -> tuple[Severity, str, str, str]:
    """Severity, observation, likely cause and next action.

    Raises
    ------
    KeyError
        When the catalogue has no such entry, or a placeholder of it has no value.
    """
    entry = CATALOGUE[code, case]
    seen, cause, action = (filled(text, values, entry.lines) for text in (entry.seen, entry.cause, entry.action))
    return severity or entry.severity, seen, cause, action
