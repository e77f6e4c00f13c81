"""Many devices: every log with what came of it, how devices differ, which physics they share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from trihedron.arrays import FloatArray
from trihedron.records.sessions import Change, Parameter, Repeated


@dataclass(frozen=True, eq=False)
class FleetLog:
    """One log: ``status`` with its ``reason``, the diagnosis' ``verdict`` and effects, the codes of the ``serious``
    findings, its numbers (9,) or (21,) with their errors; ``None`` where it was not calibrated."""

    name: str
    serial: str
    status: Literal["done", "refused", "crashed"]
    reason: str
    verdict: str
    effects: tuple[str, ...]
    serious: tuple[str, ...]
    is_trustworthy: bool
    n_poses: int | None
    static_rms_m_s2: float | None
    held_out_rms_m_s2: float | None
    seconds: float | None
    numbers: FloatArray | None
    std: FloatArray | None


@dataclass(frozen=True)
class Outlier:
    """A device whose number lies outside what the others make likely: ``deviation`` from their median, in ``sigmas``
    of their spread, ``p_adjusted`` over all devices and numbers."""

    serial: str
    parameter: Parameter
    value: float
    deviation: float
    sigmas: float
    p_adjusted: float


@dataclass(frozen=True)
class MixedLogs:
    """Logs taken for one device that are not: ``parameter`` differs between two of them by ``difference``."""

    serial: str
    n_logs: int
    parameter: Parameter
    difference: float


@dataclass(frozen=True)
class SharedEffect:
    """An effect of the catalogue: in how many logs and devices it was found, and the 95 % interval of the share of
    devices that have it."""

    id: str
    n_logs: int
    n_devices: int
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class FleetSummary:
    """The fleet in figures. ``repeated`` holds the spread from device to device and from session to session of one;
    ``None`` where there are too few logs. ``n_before`` results were there from an earlier run."""

    logs: tuple[FleetLog, ...]
    n_before: int
    n_diagnosed: int
    n_devices_diagnosed: int
    repeated: tuple[Repeated, ...]
    changes: tuple[Change, ...]
    outliers: tuple[Outlier, ...]
    effects: tuple[SharedEffect, ...]
    passed_over: str = ""
    mixed: tuple[MixedLogs, ...] = ()
