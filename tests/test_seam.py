"""The seam: whatever arrives, a kernel answers or rejects in words; how an array lies in memory changes nothing."""

import ast
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import trihedron
from trihedron import _core
from trihedron.estimate.session import solved
from trihedron.simulate import hand_session, scenario_by_name

STUB = ast.parse((Path(_core.__file__).parent / "_core.pyi").read_text())
INPUT_ERRORS = (ValueError, TypeError, OverflowError)
N_TRIALS = 12
"""Of every function; forty in the slow run."""


def callables() -> dict[str, ast.arguments]:
    """Every function, constructor and method of the compiled core with its declared parameters."""
    found: dict[str, ast.arguments] = {}
    for node in STUB.body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = node.args
        elif isinstance(node, ast.ClassDef):
            for item in node.body:
                if isinstance(item, ast.FunctionDef) and not item.decorator_list:
                    found[f"{node.name}.{item.name}"] = item.args
    return found


CALLABLES = callables()


def some_number(rng: np.random.Generator) -> float:
    if rng.random() < 0.7:
        return float(rng.uniform(0.01, 10.0))
    return float(rng.choice([0.0, -1.0, np.nan, np.inf, 1e300, 1e-300]))


def some_array(rng: np.random.Generator, name: str, n: int) -> np.ndarray:
    """Mostly an array of the shape its name suggests, sometimes of any other shape, order, kind or content."""
    triads = {"readings", "gyroscope", "vectors", "reading", "noise", "bias", "starts", "force", "rate", "signal"}
    if rng.random() < 0.2:
        shape = tuple(rng.integers(0, 5, rng.integers(0, 4)))
    elif name in triads:
        shape = (n, 3)
    elif name.endswith("rotations"):
        shape = (n, 3, 3)
    elif name in {"moves", "edges", "links"}:
        shape = (n, 2)
    elif "scale" in name or name in {"S", "accelerometer_basis"}:
        shape = (3, 3)
    elif name.startswith("prior") or "bias" in name or "density" in name:
        shape = (3,) if rng.random() < 0.5 else (4,)
    else:
        shape = (n,)
    values = rng.standard_normal(shape)
    if name.endswith("_s") and values.ndim:
        values = np.sort(np.abs(values), axis=0)
    spoil = rng.random()
    if values.size and spoil < 0.15:
        values.flat[int(rng.integers(values.size))] = rng.choice([np.nan, np.inf, -np.inf, 1e300])
    elif spoil < 0.2:
        values = values * 0
    form = rng.random()
    if form < 0.15:
        values = np.asfortranarray(values)
    elif form < 0.3 and values.ndim:
        values = np.repeat(values, 2, axis=0)[::2]
    elif form < 0.4:
        values.setflags(write=False)
    elif form < 0.45:
        with np.errstate(over="ignore"):
            values = values.astype(np.float32)
    elif form < 0.5:
        values = values.astype(object)
    elif form < 0.55 and values.ndim:
        values = values[::-1]
    return values


def some_value(rng: np.random.Generator, name: str, annotation: str, n: int) -> object:
    if "None" in annotation and rng.random() < 0.3:
        return None
    if annotation.startswith("FloatArray"):
        return some_array(rng, name, n)
    if "int64" in annotation or "uint" in annotation:
        array = some_array(rng, name, n)
        whole = np.nan_to_num(np.asarray(array, dtype=np.float64), posinf=9, neginf=-9)
        return np.sort(np.clip(np.abs(whole * 3), 0, 20).astype(np.int64), axis=-1 if whole.ndim else None)
    if "bool_" in annotation:
        return rng.random(n) < 0.5
    if annotation.startswith("Sequence[Sequence[int]]"):
        return [[int(v) for v in rng.integers(0, 9, rng.integers(0, 4))] for _ in range(n)]
    if annotation.startswith("Sequence[Sequence[float]]"):
        return [[some_number(rng) for _ in range(int(rng.choice([3, 3, 3, 2, 0])))] for _ in range(n)]
    if annotation.startswith("Sequence[int]"):
        return [int(v) for v in rng.integers(0, 4, n)]
    if annotation.startswith("Sequence[float]"):
        return [some_number(rng) for _ in range(int(rng.choice([3, 3, 3, n, 0])))]
    if annotation.startswith("tuple[FloatArray, FloatArray]"):
        return (some_array(rng, "S", n), some_array(rng, "bias", n))
    if annotation.startswith("bool"):
        return bool(rng.random() < 0.5)
    if annotation.startswith("int"):
        return int(rng.choice([0, 1, 2, 3, 5, 17, -1]))
    if annotation.startswith("float"):
        return some_number(rng)
    if annotation.startswith("str"):
        return "x"
    return some_instance(rng, annotation.split(" ")[0].strip("'\""), n)


def arguments(rng: np.random.Generator, declared: ast.arguments, n: int) -> tuple[list[object], dict[str, object]]:
    positional = [
        some_value(rng, a.arg, ast.unparse(a.annotation), n)
        for a in declared.args
        if a.arg not in {"cls", "self"} and a.annotation is not None
    ]
    named = {a.arg: some_value(rng, a.arg, ast.unparse(a.annotation), n) for a in declared.kwonlyargs if a.annotation}
    return positional, named


def some_instance(rng: np.random.Generator, name: str, n: int) -> object:
    """An object of a class of the core, from random arguments that its constructor accepts, or a plain stand-in."""
    if name == "NormFit":
        readings = rng.standard_normal((20, 3))
        readings *= 9.8 / np.linalg.norm(readings, axis=1, keepdims=True)
        return _core.fit_norm(readings, np.tile(np.eye(3), (20, 1, 1)), _core.NormSettings(9.8))
    if name == "AllanKind":
        kinds = ("Overlapping", "NonOverlapping", "Modified", "Hadamard", "Total")
        return getattr(_core.AllanKind, kinds[int(rng.integers(len(kinds)))])
    declared = CALLABLES.get(f"{name}.__new__")
    for _ in range(20 if declared else 0):
        positional, named = arguments(rng, declared, n)
        try:
            return getattr(_core, name)(*positional, **named)
        except INPUT_ERRORS:
            continue
    return object()


MADE_BY_A_RUN = ("SessionPoses", "SessionModel", "NormKalman", "AxisKalmanModel", "SpectralBins")


@cache
def made() -> dict[str, object]:
    """Objects with methods as a calibration, a Kalman filter and an Allan analysis make them, one a class."""
    kept: dict[str, object] = {"AllanStream": _core.AllanStream(3, [1, 2, 100], _core.AllanStream.LEAST_BUDGET)}

    def kept_too(plain: Callable, name: str, part: Callable = lambda one: one) -> Callable:
        def call(*positional: object, **named: object) -> object:
            one = plain(*positional, **named)
            kept[name] = part(one)
            return one

        return call

    motion = hand_session(n_poses=10, pose_s=2.0, move_s=1.0)
    log = trihedron.simulate(replace(scenario_by_name("hand-session"), motion=motion), 3)[0]
    with pytest.MonkeyPatch.context() as patch:
        for name in MADE_BY_A_RUN:
            patch.setattr(_core, name, kept_too(getattr(_core, name), name))
        fit = kept_too(solved.solve_session, "SessionFit", lambda solution: solution.core)
        patch.setattr(solved, "solve_session", fit)
        trihedron.calibrate(log, gravity_m_s2=9.80665)
        trihedron.kalman(log, gravity_m_s2=9.80665)
        trihedron.identify_noise(np.random.default_rng(0).standard_normal(4000), 100.0)
    assert {type(one).__name__ for one in kept.values()} == {*MADE_BY_A_RUN, "AllanStream", "SessionFit"}
    return kept


# Methods of what only a fit to a reference makes, and of plain numbers.
NOT_ATTACKED = ("ReferenceBlocks.", "ReferenceLog.", "AllanKind.", "AllanNoise.")


@pytest.mark.parametrize("name", [n for n in CALLABLES if n.endswith("__new__") or not n.startswith(NOT_ATTACKED)])
@pytest.mark.parametrize("trials", [range(N_TRIALS), pytest.param(range(N_TRIALS, 40), marks=pytest.mark.slow)])
def test_any_arguments_are_answered_or_refused_in_words(name, trials):
    owner, _, method = name.rpartition(".")
    for trial in trials:
        # Seeded by name and trial, so that a new function does not change what the others are given.
        rng = np.random.default_rng([trial, *name.encode()])
        n = int(rng.choice([0, 1, 2, 3, 4, 8, 30]))
        positional, named = arguments(rng, CALLABLES[name], n)
        if method == "__new__":
            target = getattr(_core, owner)
        else:
            target = getattr(made()[owner] if owner else _core, method)
        try:
            target(*positional, **named)
        except INPUT_ERRORS as rejection:
            sentence = str(rejection)
            assert sentence


def contiguous_calls() -> dict[str, tuple]:
    """A good call of the functions that take whole recordings or many vectors."""
    rng = np.random.default_rng(7)
    vectors, unit = rng.standard_normal((50, 3)), rng.standard_normal((60, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    windows = np.array([[10, 60], [80, 150]], dtype=np.int64)
    calls = {
        "rotation_from_vector": (vectors,),
        "vector_from_rotation": (_core.rotation_from_vector(vectors),),
        "block_statistics": (rng.standard_normal((400, 3)), 8),
        "integrate_raw_rate": (np.arange(200) / 100.0, rng.standard_normal((200, 3)), windows, 1),
        "simulate_first_order": (rng.standard_normal((100, 3)), 0.01, [0.1, 0.2, 0.3]),
    }
    return {name: call for name, call in calls.items() if hasattr(_core, name)}


def rearranged(array: np.ndarray) -> list[np.ndarray]:
    """The same numbers lying otherwise in memory."""
    frozen = array.copy()
    frozen.setflags(write=False)
    wide = np.zeros((*array.shape[:-1], 2 * array.shape[-1]), dtype=array.dtype)
    wide[..., ::2] = array
    return [np.asfortranarray(array), np.repeat(array, 3, axis=0)[::3], wide[..., ::2], array[::-1][::-1], frozen]


def flat(result: object) -> list[np.ndarray]:
    if isinstance(result, (tuple, list)):
        return [leaf for item in result for leaf in flat(item)]
    return [np.asarray(result)]


@pytest.mark.parametrize("name", contiguous_calls())
def test_how_an_array_lies_in_memory_changes_nothing_and_nothing_is_written_to_it(name):
    call = contiguous_calls()[name]
    expected = flat(getattr(_core, name)(*call))
    for i, argument in enumerate(call):
        np.testing.assert_array_equal(argument, contiguous_calls()[name][i])
        for other in rearranged(argument) if isinstance(argument, np.ndarray) else ():
            got = flat(getattr(_core, name)(*call[:i], other, *call[i + 1 :]))
            for a, b in zip(got, expected, strict=True):
                np.testing.assert_array_equal(a, b)
    # Another number of columns is rejected with the shape.
    i = next(i for i, one in enumerate(call) if getattr(one, "ndim", 0) > 1)
    with pytest.raises(ValueError, match=r"shape|columns|\(n, 3"):
        getattr(_core, name)(*call[:i], call[i][..., :2], *call[i + 1 :])


def test_the_allan_kernels_refuse_an_array_they_would_have_to_copy():
    # Long logs are not copied behind the caller's back; in the wrong order they would be read down the columns.
    x = np.asfortranarray(np.random.default_rng(1).standard_normal((100, 3)))
    with pytest.raises(ValueError, match="C-contiguous"):
        _core.allan_variance(x, [1, 2], _core.AllanKind.Overlapping)
