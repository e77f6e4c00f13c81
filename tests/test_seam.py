"""The seam: a kernel answers or rejects in words, with the same bits whatever the threads, however an array lies."""

import ast
import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from trihedron import _core

STUB = ast.parse((Path(_core.__file__).parent / "_core.pyi").read_text())
# Functions and constructors of the compiled core with their declared parameters.
CALLABLES = {node.name: node.args for node in STUB.body if isinstance(node, ast.FunctionDef)}
CLASSES = [node for node in STUB.body if isinstance(node, ast.ClassDef)]
CALLABLES |= {kind.name: one.args for kind in CLASSES for one in kind.body if getattr(one, "name", "") == "__new__"}
KINDS = ("empty", "not finite", "flat", "deep", "no number")
ARRAYS = (
    np.zeros((0, 3)), np.full((4, 3), np.nan), np.arange(5.0), np.ones((2, 2, 2, 2)), np.array(["x", None], object),
)  # fmt: skip
LISTS = ([], [float("nan")] * 3, [-1], [10**30], ["x"])
NUMBERS = (0, float("nan"), -1, 10**30, object())


def odd(annotation: str, kind: int) -> object:
    """A value that no kernel can work on, by what is declared."""
    if "Array" in annotation:
        is_whole = "int" in annotation and KINDS[kind] in ("empty", "flat")
        return ARRAYS[kind].astype(np.int64) if is_whole else ARRAYS[kind]
    if annotation.startswith("Sequence"):
        return LISTS[kind]
    return NUMBERS[kind] if annotation.startswith(("int", "float", "bool")) else object()


@pytest.mark.parametrize("name", CALLABLES)
def test_odd_arguments_are_answered_or_refused_in_words(name):
    declared = [a for a in (*CALLABLES[name].args, *CALLABLES[name].kwonlyargs) if a.annotation]
    for first in range(len(KINDS)):
        # Another kind for every argument in turn.
        given = {a.arg: odd(ast.unparse(a.annotation), (first + k) % len(KINDS)) for k, a in enumerate(declared)}
        said = "answered"
        try:
            getattr(_core, name)(**given)
        except (ValueError, TypeError, OverflowError) as rejection:
            said = str(rejection)
        assert said, KINDS[first]


def contiguous_calls() -> dict[str, tuple]:
    """A good call of the functions that take whole recordings or many vectors."""
    rng = np.random.default_rng(7)
    vectors, unit = rng.standard_normal((50, 3)), rng.standard_normal((60, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    windows = np.array([[10, 60], [80, 150]], dtype=np.int64)
    return {
        "rotation_from_vector": (vectors,),
        "vector_from_rotation": (_core.rotation_from_vector(vectors),),
        "block_statistics": (rng.standard_normal((400, 3)), 8),
        "integrate_raw_rate": (np.arange(200) / 100.0, rng.standard_normal((200, 3)), windows, 1),
        "simulate_first_order": (rng.standard_normal((100, 3)), 0.01, [0.1, 0.2, 0.3]),
    }


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


LIBRARIES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS", "POLARS_MAX_THREADS")
PROGRAM = """
import json, numpy as np, trihedron
from trihedron import _core
rng = np.random.default_rng(8)
t = np.cumsum(rng.uniform(0.005, 0.015, 60_000)); w = 2.0 * rng.standard_normal((60_000, 3))
up = rng.standard_normal((60_000, 3)); up *= 9.8 / np.linalg.norm(up, axis=1, keepdims=True)
readings = up @ np.array([[1.02, 0, 0], [0.01, 0.97, 0], [-0.02, 0.03, 1.0]]).T + [0.1, -0.2, 0.3]
readings += 1e-3 * rng.standard_normal((60_000, 3))
out = [trihedron.integrate_rate(t, w)[[1500, -1]]]
for length in (2, 3, 7, 8, 9, 16, 41, 200):
    out += _core.block_statistics(w[:9001], length)[:2]
for kind in (_core.AllanKind.Overlapping, _core.AllanKind.Hadamard):
    out += _core.allan_variance(readings, [1, 8, 512], kind)[:1]
edges, anchors = np.array([[3, 700], [701, 1490]]), np.array([[-1.0, 8.0], [6.0, 20.0]])
zero = np.full((2, 3), 0.01)
noise = _core.RateNoise(np.full(3, 1e-4), 1e-4, 0.01)
out += _core.integrate_moves(t, w, edges, anchors, 1.01 * np.stack([np.eye(3)] * 2), zero, zero, 3, noise)
for few in (readings[:37], readings[:2000]):
    fit = _core.fit_norm(few, 1e-6 * np.eye(3)[None], 9.8)
    out += [fit.S, fit.b, fit.residuals]
print(json.dumps(np.concatenate([np.ravel(part) for part in out]).tolist()))
"""


@cache
def answers(instructions: str, threads: str = "1") -> np.ndarray:
    path = os.pathsep.join(p for p in sys.path if p)
    environment = {**os.environ, **dict.fromkeys(LIBRARIES, threads), "PYTHONPATH": path}
    environment["TRIHEDRON_INSTRUCTIONS"] = instructions
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)
    return np.array(json.loads(done.stdout))


def test_sums_shared_between_threads_have_the_same_bits():
    np.testing.assert_array_equal(answers("widest", "3"), answers("widest"))


@pytest.mark.parametrize("instructions", ["avx2", "portable"])
def test_every_set_of_instructions_gives_the_same_answers(instructions):
    # Numbers of order one to ten after thousands of operations; fits stop within 1e-12 of the same minimum.
    np.testing.assert_allclose(answers(instructions), answers("widest"), rtol=0.0, atol=2e-11)
