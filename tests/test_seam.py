"""The seam: whatever arrives, a kernel answers or rejects in words; how an array lies in memory changes nothing."""

import ast
from pathlib import Path

import numpy as np
import pytest

from trihedron import _core

STUB = ast.parse((Path(_core.__file__).parent / "_core.pyi").read_text())


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


@pytest.mark.parametrize("first", range(len(KINDS)), ids=KINDS)
@pytest.mark.parametrize("name", [n for n in CALLABLES if "." not in n or n.endswith("__new__")])
def test_odd_arguments_are_answered_or_refused_in_words(name, first):
    declared = [a for a in (*CALLABLES[name].args, *CALLABLES[name].kwonlyargs) if a.annotation]
    # Another kind for every argument in turn.
    given = {a.arg: odd(ast.unparse(a.annotation), (first + k) % len(KINDS)) for k, a in enumerate(declared)}
    said = "answered"
    try:
        getattr(_core, name.removesuffix(".__new__"))(**given)
    except (ValueError, TypeError, OverflowError) as rejection:
        said = str(rejection)
    assert said


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
