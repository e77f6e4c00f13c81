"""Empirical relations as the records that reports and files show."""

from dataclasses import replace

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.effects.contract import SENSORS, measured
from trihedron.diagnose.hypothesis import held_out_records
from trihedron.diagnose.relations.search import Follows, Related
from trihedron.diagnose.relations.signals import WORLD_VECTOR
from trihedron.diagnose.residuals.within_poses import noise_changes
from trihedron.diagnose.session.observations import Observations
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.probability import CLEAR
from trihedron.records.diagnosis import EffectParameter, Relation
from trihedron.records.words import relation_experiment, relation_resembles, words


def records(found: Related) -> tuple[Relation, ...]:
    """Every relation with its coefficients and its held-out prediction of poses and moves, largest share first."""
    models = [*(one.before for one in found.relations[1:]), found.model]
    first = len(found.model.terms) - len(found.relations)
    out = []
    for k, (one, after) in enumerate(zip(found.relations, models[: len(found.relations)], strict=True)):
        value, covariance = found.model.value(first + k)
        held = next((h for h in held_out_records(one.before, after) if h.domain == one.effect.domain), None)
        # Share of the held-out sum of squares of its domain that the relation removes.
        left = 1.0 if held is None or not held.rms_before > 0.0 else held.rms_after / held.rms_before
        share = float(np.clip(1.0 - left**2, 0.0, 1.0))
        made = _of_world_vector if one.effect.family == "world" else _of_variables
        out.append(replace(made(one, value, covariance, share), held_out=held))
    return tuple(sorted(out, key=lambda relation: -relation.share))


def noise_relations(obs: Observations, limit: float) -> tuple[Relation, ...]:
    """The changes that score more than ``limit``, as empirical relations of the noise to time."""
    out = []
    for one in (change for change in noise_changes(obs) if change.score > limit):
        label, *_ = SENSORS[one.sensor]
        (begins_s, _), (_, ends_s) = obs.times(obs.segments.spans[[one.first, one.last]])
        each = zip(one.channels, one.changed, strict=True)
        ratios = tuple(EffectParameter(name, one.ratio[k], one.sigma[k], "1") for name, k in each)
        said = words(
            "relation-follows-noise", sensor=label, ratios=[ratio.value for ratio in ratios],
            axes=[name[1] for name in one.channels], begins_s=begins_s, ends_s=ends_s,
        )  # fmt: skip
        form = words("relation-form-noise")
        out.append(_relation(one.sensor, ("time",), ratios, one.share, "noise", (form, said)))
    return tuple(out)


def _relation(
    sensor: int, depends_on: tuple[str, ...], coefficients: tuple[EffectParameter, ...], share: float, family: str,
    said: tuple[str, str],
) -> Relation:  # fmt: skip
    """A relation with what the catalogue says of its family; ``said`` are its form and its statement."""
    form, statement = said
    return Relation(
        SENSORS[sensor].name, depends_on, form, coefficients, share, None,
        relation_resembles(family), relation_experiment(family), statement,
    )  # fmt: skip


def _of_variables(one: Follows, value: FloatArray, covariance: FloatArray, share: float) -> Relation:
    effect, variant, out = one.effect, one.term.variant, SENSORS[one.effect.sensor].unit
    units = [out if unit == "1" else f"({out})/({unit})" for unit in variant.units]
    coefficients = effect.parameters(replace(variant, units=tuple(units)), value, covariance)
    parts = [name.rpartition(": ") for name in variant.names]
    names = list(dict.fromkeys(variable for *_, variable in parts))
    axes = list(dict.fromkeys(letter for axis, *_ in parts for letter in ([axis] if axis else AXES)))
    form = words("relation-form", axes=axes, terms=[f"c{k + 1}·({name})" for k, name in enumerate(names)])
    statement = words(
        "relation-follows", sensor=SENSORS[effect.sensor].label, is_static=not effect.is_motion, axes=axes,
        depends=tuple(names), share=share,
    )  # fmt: skip
    said = form, statement
    return _relation(effect.sensor, tuple(names), coefficients, share, effect.family, said)


def _of_world_vector(_one: Follows, value: FloatArray, covariance: FloatArray, share: float) -> Relation:
    """``bias = K Rᵀ m``: the coefficients are the products of K with the one vector m along the level axes."""
    coupling, inclination = _coupling(value.reshape(9, 3))
    rng = np.random.default_rng(0)
    drawn = [_coupling(v.reshape(9, 3), coupling) for v in rng.multivariate_normal(value, covariance, 200)]
    sigma = np.std([k for k, _ in drawn], axis=0)
    spread = float(np.std([angle for _, angle in drawn]))
    away = min(float((np.abs(coupling - s * EARTH_RATE_RAD_S * np.eye(3)) / sigma).max()) for s in (1.0, -1.0))
    family = "earth" if away < CLEAR else "world"
    coefficients = (
        *measured([f"{i}: m_{j}" for i in AXES for j in AXES], coupling.ravel(), sigma.ravel(), ["rad/s"] * 9),
        EffectParameter(words("angle-to-vertical"), inclination, spread, "deg"),
    )
    statement = words("relation-follows-world", inclination_deg=inclination, inclination_sigma_deg=spread, share=share)
    said = words("relation-form-world"), statement
    return _relation(1, (WORLD_VECTOR,), coefficients, share, family, said)


def _coupling(parts: FloatArray, like: FloatArray | None = None) -> tuple[FloatArray, float]:
    """K (3, 3) and the angle of m to the vertical [deg]: the nearest product of rank one, up to one sign of the two."""
    left, size, right = np.linalg.svd(parts, full_matrices=False)
    coupling, vector = size[0] * left[:, 0].reshape(3, 3), right[0]
    if (coupling * like).sum() < 0.0 if like is not None else np.trace(coupling) < 0.0:
        coupling, vector = -coupling, -vector
    return coupling, float(np.degrees(np.arccos(np.clip(vector[2], -1.0, 1.0))))
