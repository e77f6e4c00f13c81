"""Many devices: the result of every log, how far devices differ, which effects they share."""

from dataclasses import dataclass
from typing import Literal

from trihedron.arrays import FloatArray
from trihedron.records.sessions import Change, Parameter, Repeated


@dataclass(frozen=True, eq=False)
class FleetLog:
    """One log: ``status`` with its ``reason``, the diagnosis' ``verdict`` and effects, codes of ``serious`` findings,
    parameters ``numbers`` (9,) or (21,) with standard errors ``std``; ``None`` where not calibrated; ``reread`` is the
    action against a contradicted unit, ``warned`` are codes of warnings."""

    name: str
    serial: str
    status: Literal["done", "rejected", "crashed"]
    reason: str
    verdict: str
    effects: tuple[str, ...]
    serious: tuple[str, ...]
    is_trustworthy: bool
    n_poses: int | None
    held_out_rms_m_s2: float | None
    numbers: FloatArray | None
    std: FloatArray | None
    reread: str = ""
    warned: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outlier:
    """A device with an outlying parameter: ``deviation`` from the median of the devices, in ``sigmas`` of their spread,
    ``p_adjusted`` for the number of devices and parameters."""

    serial: str
    parameter: Parameter
    deviation: float
    sigmas: float
    p_adjusted: float


@dataclass(frozen=True)
class MixedLogs:
    """Logs under one serial number that are of different devices: ``parameter`` differs by ``difference``; ``odd`` is
    the one log that differs from all others, empty where there is none."""

    serial: str
    n_logs: int
    parameter: Parameter
    difference: float
    odd: str = ""


@dataclass(frozen=True)
class EffectCount:
    """An effect of the catalogue: number of logs and devices in which it was found, and the 95 % interval of the
    fraction of devices that have it."""

    id: str
    n_logs: int
    n_devices: int
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class FleetSummary:
    """Statistics of the fleet. ``repeated`` is the spread between devices and between sessions of one device;
    ``None`` where there are too few logs. ``n_before`` results are from an earlier run. ``farthest`` is the largest
    deviation that makes no outlier; ``None`` where there are too few devices to tell. ``n_compared`` logs of
    ``n_devices_compared`` devices are in ``repeated`` and ``outliers``, ``passed_over`` says which others are not."""

    logs: tuple[FleetLog, ...]
    n_before: int
    n_diagnosed: int
    n_devices_diagnosed: int
    repeated: tuple[Repeated, ...]
    changes: tuple[Change, ...]
    outliers: tuple[Outlier, ...]
    effects: tuple[EffectCount, ...]
    passed_over: str = ""
    mixed: tuple[MixedLogs, ...] = ()
    farthest: Outlier | None = None
    n_compared: int = 0
    n_devices_compared: int = 0
