"""Parameters of a flight controller, collected while its log is read."""

import re
from types import MappingProxyType

from trihedron.records import Finding, Onboard, Severity
from trihedron.records.onboard import Autopilot, Stage


class Parameters:
    """Values of the parameters whose names match a pattern, at the time of the first reading."""

    def __init__(self, wanted: re.Pattern[str]) -> None:
        self._wanted = wanted
        self.values: dict[str, float] = {}
        self._changed: dict[str, None] = {}

    def note(self, name: str, value: float, *, has_readings: bool) -> None:
        """Add a parameter from the log; ``has_readings`` is True once a reading has been logged."""
        if not self._wanted.match(name):
            return
        if has_readings and self.values.get(name, value) != value:
            self._changed[name] = None
        self.values.setdefault(name, float(value))
        if not has_readings:
            self.values[name] = float(value)

    def onboard(self, autopilot: Autopilot, sensors: tuple[int, int], stage: Stage) -> Onboard | None:
        """The corrections that the parameters describe; ``None`` where the log contains none."""
        if not self.values:
            return None
        return Onboard(autopilot, *sensors, stage, MappingProxyType(dict(self.values)), tuple(self._changed))


def said_of(onboard: Onboard | None) -> tuple[Finding, ...]:
    """The finding that readings were corrected on board, and whether the parameters changed during the log."""
    if onboard is None or onboard.stage == "raw":
        return ()
    return (
        Finding.of(
            "corrected-on-board",
            severity=Severity.WARNING if onboard.changed else Severity.NOTE,
            autopilot={"ardupilot": "ArduPilot", "px4": "PX4"}[onboard.autopilot],
            accel=onboard.accel + 1,
            gyro=onboard.gyro + 1,
            is_turned=onboard.stage == "body",
            has_changed=bool(onboard.changed),
            changed=list(onboard.changed),
        ),
    )
