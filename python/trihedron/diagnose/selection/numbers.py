"""The numbers of the final model with error bars for what remains: scatter of the poses, misfit of the moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.selection.model import StepwiseModel
from trihedron.diagnose.selection.shapes import with_shapes
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit, tune_noise
from trihedron.diagnose.session.twin import stacked
from trihedron.diagnose.zeros.of_session import (
    SessionEvidence,
    accel_evidence,
    gyro_evidence,
    with_accel_scatter,
    with_gyro_scatter,
)
from trihedron.records.domains import DomainTest

SCATTERS = 0.01
"""p-value from which poses scatter enough for their error bars, though too little for a name."""
WEIGHTS = ("hold_force_sigma", "hold_rate_sigma", "zero_scatter")


def final_numbers(model: StepwiseModel, remaining: tuple[DomainTest, ...]) -> tuple[StepwiseModel, Fit]:
    """The model fitted once more, poses as uncertain as their zeros scatter, moves as they miss (eq. 8.19).

    What nothing explains counts with the size it shows: else the fit bends S and b to it and says small errors of both.
    Shape numbers (time constants, widths) are fitted along, so that every error bar allows for theirs; the model that
    comes back has them. A healthy recording keeps its fit.
    """
    obs = _as_it_shows(model, remaining)
    same = all(getattr(obs, name) is getattr(model.obs, name) for name in WEIGHTS) and (
        obs.moves_inflation == model.obs.moves_inflation and obs.dynamics_inflation == model.obs.dynamics_inflation
    )
    plain = model.fitted if same else tune_noise(obs, model.fitted.twin, stacked(model.distortions), model.prior)
    return with_shapes(model, plain)


def linear_numbers(bare: StepwiseModel, domains: tuple[DomainTest, ...]) -> Fit:
    """The linear model alone, as uncertain as what disagrees with it shows, as a calibration is."""
    return final_numbers(bare, domains)[1] if any(one.disagrees for one in domains) else bare.fitted


def _as_it_shows(model: StepwiseModel, remaining: tuple[DomainTest, ...]) -> Observations:
    """The observations as uncertain as what remains shows them to be."""
    obs = model.obs
    context = model.context
    named = {one.effect.id for one in model.accepted}
    left = {d.domain: d.chi2_per_dof for d in remaining if d.disagrees}
    accel = None if "accel-zero-scatter" in named else accel_evidence(context)
    if _scatters(accel):
        assert accel is not None
        obs = with_accel_scatter(obs, float(accel.evidence.scatter[0]), context.si_per_raw("accelerometer"))
    elif "static-accel" in left:
        wider = float(np.sqrt(max(left["static-accel"], 1.0)))
        along = None if obs.force_up is None else (obs.force_up[0], obs.force_up[1] * wider)
        obs = replace(obs, hold_force_sigma=obs.hold_force_sigma * wider, force_up=along)
    gyro = None if "gyro-zero-scatter" in named else gyro_evidence(context)
    if _scatters(gyro):
        assert gyro is not None
        obs = with_gyro_scatter(obs, gyro.evidence.scatter, context.si_per_raw("gyroscope"))
    elif "static-gyro" in left and obs.hold_rate_sigma is not None and obs.hold_creep is None:
        rates: FloatArray = obs.hold_rate_sigma * np.sqrt(max(left["static-gyro"], 1.0))
        obs = replace(obs, hold_rate_sigma=rates)
    return replace(
        obs,
        moves_inflation=max(obs.moves_inflation, float(np.sqrt(max(left.get("moves", 1.0), 1.0)))),
        dynamics_inflation=max(obs.dynamics_inflation, float(np.sqrt(max(left.get("dynamics", 1.0), 1.0)))),
    )


def _scatters(found: SessionEvidence | None) -> bool:
    return found is not None and found.evidence.p_scatter_spared < SCATTERS
