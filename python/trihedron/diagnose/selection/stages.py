"""How well poses and moves are predicted that the fit did not see: with numbers alone, and with the effects."""

from __future__ import annotations

from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS, physical_rms
from trihedron.diagnose.selection.model import StepwiseModel
from trihedron.records.diagnosis import Stage, StageDomain


def held_out_stages(bare: StepwiseModel, model: StepwiseModel) -> tuple[Stage, ...]:
    """The recording predicted by its own numbers, and, where effects were accepted, by numbers and effects."""
    stages = (Stage("numbers", _domains(bare)),)
    return (*stages, Stage("effects", _domains(model))) if model.accepted else stages


def _domains(model: StepwiseModel) -> tuple[StageDomain, ...]:
    prediction = model.prediction
    rms, unit = physical_rms(model.fitted, prediction.innovation)
    return tuple(
        StageDomain(name, rms[d], float(prediction.chi2[d] / prediction.n_rows[d]), unit[d])
        for d, name in ROW_DOMAINS.items()
        if d in rms and prediction.n_rows[d] >= 1.0
    )
