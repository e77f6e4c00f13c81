"""The fleet as a table: one row per log."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trihedron.arrays import sigmas_of
from trihedron.files.output import write_whole
from trihedron.records.fleet import FleetSummary
from trihedron.records.sessions import PARAMETERS
from trihedron.sanitise import escaped

if TYPE_CHECKING:
    import polars

PLAIN = (
    *("path", "serial", "status", "reason", "verdict", "effects", "warnings", "serious", "is_trustworthy"),
    *("n_samples", "duration_s", "rate_hz", "n_poses", "start_epoch_s", "temperature_degc", "gravity_m_s2"),
    *("accelerometer_unit", "gyroscope_unit", "static_rms_m_s2", "held_out_rms_m_s2", "seconds"),
    *("sha256", "version", "key"),
)


def write_tables(rows: Sequence[dict[str, Any]], summary: FleetSummary, folder: Path) -> None:
    """Write ``fleet.parquet``, ``fleet.csv`` and ``fleet.html`` to the folder; those of an earlier run are replaced."""
    from trihedron.report.fleet import fleet_report
    from trihedron.report.page import to_html

    frame = frame_of(rows)
    buffer = io.BytesIO()
    frame.write_parquet(buffer)
    write_whole(folder / "fleet.parquet", buffer.getvalue(), overwrite=True)
    write_whole(folder / "fleet.csv", frame.write_csv(), overwrite=True)
    write_whole(folder / "fleet.html", to_html(fleet_report(summary)), overwrite=True)


def frame_of(rows: Sequence[dict[str, Any]]) -> polars.DataFrame:
    """One row per log: its name, its result, and the 21 parameters with their standard errors (units in the names).

    Control characters in names are escaped, since a table is shown on terminals.
    """
    import polars

    text = {"path", "serial", "status", "reason", "verdict", "effects", "warnings", "serious"}
    text |= {"accelerometer_unit", "gyroscope_unit", "sha256", "version", "key"}
    columns: dict[str, list[Any]] = {name: [_cell(row, name) for row in rows] for name in PLAIN}
    numbers = [row.get("parameters") or () for row in rows]
    std = [sigmas_of(np.array(row.get("covariance") or np.zeros((0, 0)))) for row in rows]
    for k, parameter in enumerate(PARAMETERS):
        name = f"{parameter.id}_{parameter.name}".replace("-", "_")
        unit = {"m/s^2": "_m_s2", "rad/s": "_rad_s", "rad": "_rad", "1": "_ln_raw_per_si"}[parameter.unit]
        columns[name + unit] = [one[k] if k < len(one) else None for one in numbers]
        columns[f"{name}_std"] = [float(one[k]) if k < len(one) else None for one in std]
    kinds: dict[str, Any] = {name: polars.String if name in text else polars.Float64 for name in columns}
    kinds |= {"is_trustworthy": polars.Boolean, "n_samples": polars.Int64, "n_poses": polars.Int64}
    return polars.DataFrame(columns, schema=kinds, strict=False)


def _cell(row: dict[str, Any], name: str) -> Any:
    diagnosis = row.get("diagnosis") or {}
    if name == "verdict":
        return diagnosis.get("verdict", "")
    if name == "effects":
        return " ".join(effect["id"] for effect in diagnosis.get("effects", ()))
    if name in ("warnings", "serious"):
        return " ".join(row.get(name) or ())
    value = row.get(name)
    return escaped(value) if isinstance(value, str) else value
