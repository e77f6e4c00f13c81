"""The model as it stands after a step of the selection: observations, fit, and the effects accepted so far."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant
from trihedron.diagnose.effects.direct import Evidence
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import N_DOMAINS, Fit, Prediction, folds_of, predict_held_out, tune_noise
from trihedron.diagnose.session.twin import Distortion, Prior, Twin, stacked
from trihedron.records.domains import HeldOut


@dataclass(frozen=True, eq=False)
class Alternative:
    """An effect that might stand in another's place, its columns, and how many directions of them are seen."""

    effect: Effect
    variant: Variant
    rank: int


@dataclass(frozen=True, eq=False)
class Accepted:
    """One effect in the model, before it is put into words.

    ``variant`` are its columns in the fit, ``evidence`` what its own test found; one of the two may be ``None``.
    ``gain`` is what it wins in 2 log-likelihood (or in chi-square, where it changes the observations) beside all the
    others, ``rivals`` are ids of effects that explain the recording as well, ``rank`` counts the directions of its
    columns that the calibration does not imitate, ``alternatives`` are variants that explained much when it was chosen.
    """

    effect: Effect
    variant: Variant | None
    evidence: Evidence | None
    p_adjusted: float
    delta_bic: float
    gain: float
    held_out: tuple[HeldOut, ...]
    rivals: tuple[str, ...] = ()
    rank: int = 0
    alternatives: tuple[Alternative, ...] = ()

    @property
    def reobserves(self) -> bool:
        """Whether it changes what the observations claim (samples put back, moves left out, noise of a coarse code)."""
        return self.evidence is not None and self.evidence.reweigh is not None


@dataclass(frozen=True, eq=False)
class StepwiseModel:
    """A session's model with some effects; every step of the selection takes one and returns another.

    ``bare`` are the observations before any effect changed them, ``start`` and ``prior`` where every fit begins;
    ``context`` is what effects look at, kept with all that they computed while observations and fit stay the same;
    ``refused`` names effects whose mending did not predict held-out moves any better.
    """

    bare: Observations
    start: Twin
    prior: Prior | None
    context: Context
    prediction: Prediction
    accepted: tuple[Accepted, ...] = ()
    refused: frozenset[str] = field(default_factory=frozenset)

    @property
    def obs(self) -> Observations:
        """The observations as they now are."""
        return self.context.obs

    @property
    def fitted(self) -> Fit:
        """The fit with everything accepted."""
        return self.context.fitted

    @property
    def distortions(self) -> list[Distortion]:
        """Columns of the accepted effects, in the order of the fit's parameters."""
        return [one.variant.distortion for one in self.accepted if one.variant is not None]

    def refusing(self, effect_id: str) -> StepwiseModel:
        """The same model, which remembers that an effect's mending does not help."""
        return replace(self, refused=self.refused | {effect_id})


def begin(obs: Observations, start: Twin, prior: Prior | None) -> StepwiseModel:
    """The session without any effect."""
    fitted = tune_noise(obs, start, stacked([]), prior)
    return StepwiseModel(obs, start, prior, Context(obs, fitted), held_out(fitted))


def held_out(fitted: Fit) -> Prediction:
    """Prediction of blocks of poses and moves that the fit did not see."""
    return predict_held_out(fitted, folds_of(fitted), N_DOMAINS)


def with_only(model: StepwiseModel, kept: tuple[Accepted, ...]) -> StepwiseModel:
    """The model made again from the bare observations with some of its effects, every other number fitted anew.

    Where the observations are no longer the same ones (samples put back or taken out), columns are made again from the
    motion that the mended observations show; an effect that these do not show (a pose pushed in them alone) goes too.
    """
    obs = model.obs
    if [one for one in kept if one.reobserves] != [one for one in model.accepted if one.reobserves]:
        obs = observed_with(model.bare, [one.evidence for one in kept if one.evidence is not None])
        kept = on_observations(model, obs, kept)
    distortion = stacked([one.variant.distortion for one in kept if one.variant is not None])
    start = replace(_start_on(model, obs), effect=np.zeros(distortion.n_parameters))
    fitted = tune_noise(obs, start, distortion, model.prior)
    return replace(model, context=Context(obs, fitted), prediction=held_out(fitted), accepted=kept)


def observed_with(bare: Observations, found: list[Evidence]) -> Observations:
    """The bare observations as what was found changes them; samples are put back first, for that makes them anew."""
    for evidence in sorted(found, key=lambda one: one.touched is None):
        if evidence.reweigh is not None:
            bare = evidence.reweigh(bare)
    return bare


def on_observations(model: StepwiseModel, obs: Observations, kept: tuple[Accepted, ...]) -> tuple[Accepted, ...]:
    """Effects with their columns as other observations show the motion, without those that these do not show."""
    if not any(one.variant is not None for one in kept):
        return kept
    plain = Context(obs, tune_noise(obs, _start_on(model, obs), stacked([]), model.prior))
    return tuple(again for one in kept if (again := _made_again(one, plain)) is not None)


def _start_on(model: StepwiseModel, obs: Observations) -> Twin:
    """Where the fit begins: the present optimum while the holds are the same ones."""
    twin = model.fitted.twin if obs.n_holds == model.obs.n_holds else model.start
    return replace(twin, effect=np.zeros(0))


def _made_again(one: Accepted, context: Context) -> Accepted | None:
    if one.variant is None:
        return one
    again = one.effect.made_again(context, one.variant)
    return None if again is None else replace(one, variant=again)
