"""The grid of an ADC's values against its NumPy twin."""

import numpy as np
import pytest

from trihedron import _core

ARITHMETIC = 1e-9
WRITTEN = 0.02
MOST_WRITTEN = 0.05
QUANTILES = (0.9, 0.75, 0.5, 0.25, 0.1, 0.05, 0.01, 0.0)
OFF_GRID = 0.18
ON_GRID = 0.95
REACH = 20.0
DENSE = 32
WIDER = 4.0
TESTABLE = 8
BY_CHANCE = 1e-3
REPEATS = 2
DRIFT = 0.3
MOST_GAPS = 4096


def grid_twin(levels, n):
    if len(levels) < 2:
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > ARITHMETIC * max(abs(float(levels[0])), abs(float(levels[-1])))]
    if not len(gaps) or (len(gaps) < TESTABLE and n < REPEATS * len(levels)):
        return 0.0
    gaps = gaps[:: -(-len(gaps) // MOST_GAPS)]
    tried = np.unique(np.quantile(gaps, QUANTILES, method="nearest"))[::-1]
    left = np.abs(gaps - tried[-1] * np.rint(gaps / tried[-1]))
    left = left[left > OFF_GRID * tried[-1]]
    rest = [float(left.min())] if len(left) else []
    step = next((step for one in [*tried.tolist(), *rest] if (step := spacing_twin(gaps, one))), 0.0)
    if not step:
        return 0.0
    step = refined_twin(levels, step)
    return round(step) if step > 0.5 and np.array_equal(levels, np.rint(levels)) else step


def refined_twin(levels, step):
    wide = min(DENSE, len(levels) - 1)
    densest = int(np.argmin(levels[wide:] - levels[: len(levels) - wide]))
    middle = levels[densest + wide // 2]
    reach, widest = REACH, float(np.ptp(levels))
    while True:
        near = levels[np.abs(levels - middle) <= reach * step] - middle
        place = np.rint(near / step)
        if float(np.mean(np.abs(near / step - place) < OFF_GRID)) < ON_GRID:
            return step
        place -= place.mean()
        squares = float(place @ place)
        step = float(place @ near) / squares if squares > 0.0 else step
        if reach * step > widest:
            return step
        reach *= WIDER


def spacing_twin(gaps, near):
    is_apart = gaps > WRITTEN * near
    if float(gaps[~is_apart].sum()) > MOST_WRITTEN * near * np.count_nonzero(is_apart):
        return 0.0
    gaps = gaps[is_apart]
    step = near
    for reach in (1.0, 3.0, REACH, REACH):
        whole = np.rint(gaps / step)
        used = (whole >= 1.0) & (whole <= reach)
        if used.any():
            step = float(gaps[used].sum() / whole[used].sum())
    places = gaps / step
    places = places[places < REACH + 0.5]
    n = len(places)
    if n < min(TESTABLE, len(gaps)) or abs(step / near - 1.0) > DRIFT:
        return 0.0
    whole = np.rint(places)
    is_one_apart = bool(np.all(whole == 1.0))
    few = OFF_GRID if n >= TESTABLE or is_one_apart else min(OFF_GRID, 0.5 * BY_CHANCE ** (1.0 / (n - 1)))
    on = (np.abs(places - whole) < few) & (whole > 0.0)
    return step if float(np.mean(on)) >= ON_GRID else 0.0


def values(kind, seed):
    """Readings of one kind, and their spacing as far as it is known."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-4.0, 4.0)
    noise = rng.normal(size=int(10 ** rng.uniform(1.0, 3.7))) * 10.0 ** rng.uniform(-0.5, 2.5)
    return {
        "counts": np.rint(noise),
        "every third code": 3.0 * np.rint(noise) + 7.0,
        "a unit": size * np.rint(noise),
        "three digits of text": np.round(noise, 3),
        "digits cut off": np.round(0.0598 * np.rint(noise), 3),
        "two spellings": 0.25 * np.rint(noise) + 0.001 * (rng.random(len(noise)) < 0.3),
        "continuous": size * noise,
        "a large offset": 1e6 + size * np.rint(noise),
        "mostly one code": np.where(rng.random(len(noise)) < 0.97, 0.0, np.rint(noise)),
        "two steps": np.concatenate([0.5 * np.rint(noise), 0.3 * np.rint(noise)]),
    }[kind]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    "kind",
    [
        "counts",
        "every third code",
        "a unit",
        "three digits of text",
        "digits cut off",
        "two spellings",
        "continuous",
        "a large offset",
        "mostly one code",
        "two steps",
    ],
)
def test_the_step_of_a_grid_is_that_of_a_plain_twin(kind, seed):
    levels, n = _core.levels_of(values(kind, seed))
    found = _core.converter_grid(levels, n) or 0.0
    # Sums of some thousand gaps in another order.
    assert found == pytest.approx(grid_twin(levels, n), rel=1e-12)


def test_twins_see_grids_and_none():
    """The comparison above is of both answers."""
    found = [_core.converter_grid(*_core.levels_of(values("counts", seed))) for seed in range(8)]
    assert found.count(1.0) >= 6
    assert all(_core.converter_grid(*_core.levels_of(values("continuous", seed))) is None for seed in range(8))


def test_levels_that_do_not_ascend_are_refused():
    for levels in ([1.0, 1.0], [2.0, 1.0], [0.0, np.nan], [0.0, np.inf]):
        with pytest.raises(ValueError, match="ascend"):
            _core.converter_grid(np.array(levels), 10)
