"""An experiment before it is made: what it would tell, and how certainly."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from trihedron.records.plan import ExperimentPlan, PosePlan
from trihedron.report.document import Document, Facts, Paragraph, Section, Table
from trihedron.report.numbers import plain_number
from trihedron.units import degrees_from_radians, mg_from_m_s2, mm_s2_from_m_s2, mrad_from_radians


def plan_report(plan: ExperimentPlan) -> Document:
    """Lay out the plan: turns by both routes, sets of poses, moves."""
    turns = plan.turns
    angles = ", ".join(f"{angle:g}°" for angle in turns.angles_deg)
    return Document(
        title="Plan of an experiment",
        subtitle=(
            f"gyro noise {plain_number(degrees_from_radians(plan.gyroscope_density), 2)} °/s/√Hz, accelerometer noise "
            f"{plain_number(1e3 * mg_from_m_s2(plan.accelerometer_density), 2)} µg/√Hz, poses of {plan.pose_s:g} s"
        ),
        verdict=f"Turns of {angles} in {turns.duration_s:g} s about each axis give the gyro's scale to "
        f"{_percent(turns.scale)}.",
        is_trustworthy=True,
        sections=(
            Section("Known turns (method 1)", (_turns(plan),)),
            Section(
                "Poses (method 2)",
                (
                    _poses(plan.poses),
                    Facts(tuple((pose.name, _worth(pose)) for pose in plan.poses if pose.worth)),
                ),
            ),
            Section(
                "Moves between poses (method 2)",
                (
                    Table(
                        ("moves", "how many", "of 9 parameters", "scale uncertainty (1 σ)"),
                        tuple(
                            (move.name, f"{move.n_moves}", f"{move.rank}", _percent(move.scale)) for move in plan.moves
                        ),
                    ),
                    Paragraph(
                        "A move determines two parameters, for a turn about the vertical leaves gravity where it was: "
                        "three turns about level axes show six of nine, and all nine if each stops once on the way."
                    ),
                ),
            ),
        ),
    )


def plan_record(plan: ExperimentPlan) -> dict[str, Any]:
    """As plain JSON types; what is not determined is null."""
    record: dict[str, Any] = _plain(asdict(plan))
    return record


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and math.isinf(value) else value


def _turns(plan: ExperimentPlan) -> Table:
    turns = plan.turns
    rows = (
        ("turns and bias together", turns.scale, turns.zero),
        ("bias first, then the turns", turns.scale_zero_first, turns.zero_zero_first),
    )
    return Table(
        ("standard uncertainty (1 σ)", "gyro scale", "gyro bias"),
        tuple(
            (name, _percent(scale), f"{plain_number(degrees_from_radians(zero), 2)} °/s") for name, scale, zero in rows
        ),
    )


def _poses(poses: tuple[PosePlan, ...]) -> Table:
    rows = []
    for pose in poses:
        if pose.rank < 9:
            rows.append((pose.name, f"{pose.rank}", "not determined", "not determined", "not determined"))
            continue
        rows.append(
            (
                pose.name,
                f"{pose.rank}",
                _percent(pose.scale),
                f"{plain_number(mrad_from_radians(pose.angle), 2)} mrad",
                f"{plain_number(mm_s2_from_m_s2(pose.zero), 2)} mm/s²",
            )
        )
    return Table(
        ("largest standard uncertainty (1 σ)", "of 9 parameters", "scale", "angle between axes", "bias"), tuple(rows)
    )


def _worth(pose: PosePlan) -> str:
    best = pose.worth[0]
    if math.isinf(best.loss):
        n = sum(math.isinf(one.loss) for one in pose.worth)
        which = "every pose is" if n == pose.n_poses else f"{n} of the {pose.n_poses} poses are"
        return f"{which} necessary: without it a parameter is not determined"
    # To a thousandth of a per cent: beyond that only rounding of the arithmetic is left.
    share, least = (round(100.0 * (loss - 1.0), 3) for loss in (best.loss, pose.worth[-1].loss))
    return (
        f"most useful pose: {best.pose}, +{plain_number(share, 2)} % uncertainty without it; least useful pose: "
        f"+{plain_number(least, 2)} %"
    )


def _percent(relative: float) -> str:
    return "not determined" if math.isinf(relative) else f"{plain_number(100.0 * relative, 2)} %"
