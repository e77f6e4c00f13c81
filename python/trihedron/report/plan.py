"""Report of a planned experiment: uncertainties to expect."""

import math

from trihedron.records.plan import ExperimentPlan, MovePlan, PosePlan
from trihedron.report.document import Document, Paragraph, Section, Table
from trihedron.report.numbers import MINUS, plain_number
from trihedron.units import degrees_from_radians, mg_from_m_s2, mm_s2_from_m_s2, mrad_from_radians

ALL_NUMBERS = 9
"""Number of parameters of a triad: scales, angles and biases."""
LEAST_WORTH = 0.01
"""Uncertainty of a scale from which an experiment adds little: data sheets state 1 to 3 % without one."""
LITTLE = " A data sheet states 1 to 3 % without an experiment: "


def plan_report(plan: ExperimentPlan) -> Document:
    """Lay out the plan: turns by both routes, sets of poses, moves."""
    turns = plan.turns
    # The smallest set that determines all parameters without any one of its poses.
    enough = [one for one in plan.poses if one.rank == ALL_NUMBERS and not any(math.isinf(w.loss) for w in one.worth)]
    best = min(enough, key=lambda one: one.n_poses, default=None)
    angles = ", ".join(f"{angle:g}°" for angle in turns.angles_deg).replace("-", MINUS)
    is_by_angle = plan.sigma_turn_rad > plan.gyroscope_density * math.sqrt(turns.duration_s)
    known = f", known to {degrees_from_radians(plan.sigma_turn_rad):.2g}° only," if is_by_angle else ""
    remedy = ""
    if best is None or best.scale > LEAST_WORTH:
        remedy = f"{LITTLE}more poses, or noise in another unit?"
    elif turns.scale > LEAST_WORTH:
        remedy = f"{LITTLE}turn further, {'or know the angles better.' if known else 'or is noise in another unit?'}"
    return Document(
        title="Plan of an experiment",
        subtitle=(
            f"gyro noise {plain_number(degrees_from_radians(plan.gyroscope_density), 2)} °/s/√Hz, accelerometer noise "
            f"{plain_number(1e3 * mg_from_m_s2(plan.accelerometer_density), 2)} µg/√Hz, poses of {plan.pose_s:g} s"
        ),
        verdict=f"{_enough(best)}Known turns of {angles} in {turns.duration_s:g} s about each axis{known} give the "
        f"gyro's scale to {_percent(turns.scale)}{_beside_moves(plan)}.{remedy}",
        stated_level="usable" if remedy else "good",
        next_step=_next_step(plan),
        sections=(
            Section("Poses", (_poses(plan.poses),)),
            Section("Moves between poses", _moves(plan.moves)),
            Section("Known turns", (_turns(plan),)),
        ),
    )


def _enough(best: PosePlan | None) -> str:
    """The smallest set of poses that determines the accelerometer with one to spare; empty without any."""
    if best is None:
        return ""
    return (
        f"{best.name}: all {ALL_NUMBERS} parameters of the accelerometer even if any one pose is lost (scale "
        f"{_percent(best.scale)}, 1 σ). "
    )


def _best_moves(plan: ExperimentPlan) -> MovePlan | None:
    """The moves that determine the gyro best; None where none determine all of it."""
    moves = min(plan.moves, key=lambda one: (-one.rank, one.scale), default=None)
    return moves if moves is not None and moves.rank == ALL_NUMBERS else None


def _beside_moves(plan: ExperimentPlan) -> str:
    """That moves between poses give more than turns, whose angle is too uncertain."""
    moves = _best_moves(plan)
    if moves is None or moves.scale >= plan.turns.scale:
        return ""
    return f", {moves.n_moves} moves between poses to {_percent(moves.scale)}: turn between poses instead"


def _next_step(plan: ExperimentPlan) -> str:
    """How to record the poses, and what to do between them for the gyro."""
    best = min((one.scale for one in plan.poses if one.rank == ALL_NUMBERS), default=math.inf)
    if best > LEAST_WORTH:
        return "Hold every pose longer, or check the accelerometer's noise that was given: data sheets state as much."
    step = "Record them: `trihedron capture PORT -o session.csv --guide` leads through the poses."
    moves = _best_moves(plan)
    if moves is None:
        return step
    return (
        f"{step} For the gyro, turn the sensor between them about each level axis in turn, {moves.name}: "
        f"{moves.n_moves} such moves give all {ALL_NUMBERS} of its parameters (scale {_percent(moves.scale)})."
    )


def _moves(moves: tuple[MovePlan, ...]) -> tuple[Table, Paragraph]:
    rows = tuple((move.name, f"{move.n_moves}", f"{move.rank}", _percent(move.scale)) for move in moves)
    caption = "How many of 9 parameters of the gyro moves determine, and its scale's uncertainty (1 σ)"
    said = "A move determines two parameters, for a turn about the vertical leaves gravity where it was: three turns "
    said += "about level axes show six of nine, and all nine if each stops once on the way."
    return Table(("moves", "number", "of 9", "σ of scale"), rows, caption), Paragraph(said)


def _turns(plan: ExperimentPlan) -> Table:
    turns = plan.turns
    rows = (
        ("turns and bias together", turns.scale, turns.bias),
        ("bias first, then the turns", turns.scale_bias_first, turns.bias_bias_first),
    )
    cells = tuple(
        (name, _percent(scale), f"{plain_number(degrees_from_radians(bias), 2)} °/s") for name, scale, bias in rows
    )
    head = ("standard uncertainty (1 σ)", "gyro scale", "gyro bias")
    return Table(head, cells, "What turns by known angles determine of the gyro")


def _poses(poses: tuple[PosePlan, ...]) -> Table:
    rows = []
    for pose in poses:
        cells = ("–", "–", "–")
        if pose.rank == ALL_NUMBERS:
            angle = f"{plain_number(mrad_from_radians(pose.angle), 2)} mrad"
            cells = (_percent(pose.scale), angle, f"{plain_number(mm_s2_from_m_s2(pose.bias), 2)} mm/s²")
        rows.append((pose.name, f"{pose.rank}", *cells))
    return Table(
        ("set of poses", "of 9", "scale", "axis angle", "bias"),
        tuple(rows),
        "How many of 9 parameters a set of poses determines, and the largest standard uncertainty (1 σ)",
    )


def _percent(relative: float) -> str:
    return "not determined" if math.isinf(relative) else f"{plain_number(100.0 * relative, 2)} %"
