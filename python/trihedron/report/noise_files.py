"""Noise for other programs: a JSON record with every value and its unit, and the Allan curve as a table."""

import csv
import io
import math
from collections.abc import Mapping
from typing import Any

from trihedron.records import Noise, NoiseAxis, TermName
from trihedron.report.noise import kalibr_rows
from trihedron.report.noise_units import PER_UNIT, customary

_TERM = ("value", "sigma", "lower", "upper", "limit", "evidence", "estimate", "fitted")
_CURVE = ("deviation", "lower", "upper", "edf", "n_terms")
Lengths = Mapping[str, Mapping[TermName, float | None]]


def noise_record(noise: Noise, lengths: Lengths | None = None, accuracy: float = 0.1) -> dict[str, Any]:
    """The content of the report, values in SI (or the log's own unit) with their unit.

    ``lengths`` are recording times [s] for a relative uncertainty ``accuracy`` of each term of each axis.
    """
    return {
        "source": noise.source,
        "rate_hz": noise.curve.rate_hz,
        "n_samples": noise.curve.n_samples,
        "excluded_s": [list(stretch) for stretch in noise.excluded_s],
        "breaks_s": list(noise.breaks_s),
        "accuracy": accuracy,
        "axes": [_axis_record(axis, (lengths or {}).get(axis.name, {})) for axis in noise.axes],
        "kalibr": {key: words.split()[0] for key, words in kalibr_rows(noise).items()},
        "curve": {
            **{name: getattr(noise.curve, name) for name in ("kind", "confidence", "stride")},
            "tau_s": noise.curve.tau_s.tolist(),
            "cluster": noise.curve.clusters.tolist(),
            "axes": [
                {"name": name, "unit": unit} | {of: getattr(noise.curve, of)[:, c].tolist() for of in _CURVE}
                for c, (name, unit) in enumerate(zip(noise.curve.names, noise.curve.units, strict=True))
            ],
        },
        "findings": [finding.to_dict() for finding in noise.findings],
    }


def _axis_record(axis: NoiseAxis, lengths: Mapping[TermName, float | None]) -> dict[str, Any]:
    terms = {}
    for term in TermName:
        found = axis.terms[term]
        entry: dict[str, Any] = {"present": found.is_present} | {name: getattr(found, name) for name in _TERM}
        entry["unit"] = f"{axis.unit}{PER_UNIT[term]}"
        usual = customary(term, axis.unit)
        if usual is not None:
            entry["customary"] = {"name": usual[0], "unit": usual[1], "value": usual[2] * found.value}
        if term in lengths:
            entry["recording_length_s"] = lengths[term]
        terms[term.value] = entry
    best = axis.optimal_averaging()
    lower_s, upper_s = (end if math.isfinite(end) else None for end in axis.averaging_ends_s)
    return {
        **{name: getattr(axis, name) for name in ("name", "unit", "mean", "sample_sigma", "resolution")},
        "terms": terms,
        "gauss_markov": None if axis.gauss_markov is None else dict(vars(axis.gauss_markov)),
        "slow_pair": None if axis.slow_pair is None else dict(vars(axis.slow_pair)),
        "lines": [dict(vars(line)) for line in axis.lines],
        "lowest_hz": axis.lowest_hz,
        "highest_hz": axis.highest_hz,
        "optimal_tau_s": None if best is None else best[0],
        "optimal_tau_lower_s": lower_s,
        "optimal_tau_upper_s": upper_s,
        "least_deviation": None if best is None else best[1],
        "longest_tau_s": axis.longest_tau_s,
        "covariance_scale": axis.covariance_scale,
        "findings": [finding.to_dict() for finding in axis.findings],
    }


def curve_csv(noise: Noise) -> str:
    """The Allan curve as a table: tau, cluster, then deviation, interval, degrees of freedom, terms of every axis."""
    curve = noise.curve
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    head = ["tau_s", "cluster"]
    for name, unit in zip(curve.names, curve.units, strict=True):
        columns = (f"deviation[{unit}]", f"lower[{unit}]", f"upper[{unit}]", "edf", "terms")
        head += [f"{name.replace(' ', '_')}_{column}" for column in columns]
    writer.writerow(head)
    for i, tau in enumerate(curve.tau_s):
        row = [f"{tau:.9g}", str(int(curve.clusters[i]))]
        for c in range(curve.n_channels):
            cells = (curve.deviation[i, c], curve.lower[i, c], curve.upper[i, c], curve.edf[i, c])
            row += [*(f"{float(v):.9g}" for v in cells), str(int(curve.n_terms[i, c]))]
        writer.writerow(row)
    return out.getvalue()
