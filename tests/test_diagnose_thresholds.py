"""Numbers in comparisons of the diagnosis carry a name and a reason."""

import ast
from pathlib import Path

ROOM = Path(__file__).parents[1] / "python" / "trihedron" / "diagnose"
SELF_EXPLANATORY = {-1, 0, 1, 2, 3}
"""Signs, counts of axes, halves of pairs."""


def bare_literals(path: Path) -> list[str]:
    compared = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Compare)]
    return [
        f"{path.name}:{leaf.lineno}: {ast.unparse(node)}"
        for node in compared
        for part in (node.left, *node.comparators)
        for leaf in ast.walk(part)
        if isinstance(leaf, ast.Constant)
        and isinstance(leaf.value, int | float)
        and not isinstance(leaf.value, bool)
        and leaf.value not in SELF_EXPLANATORY
    ]


def test_every_threshold_of_the_diagnosis_has_a_name():
    bare = [line for path in sorted(ROOM.rglob("*.py")) for line in bare_literals(path)]
    assert not bare, f"name these and say where they come from: {bare}"


def test_every_name_of_a_number_has_a_reason():
    """A constant is followed by its sentence, its own or that of the group it ends."""
    for path in sorted(ROOM.rglob("*.py")):
        body = ast.parse(path.read_text()).body
        for node, after in zip(body, [*body[1:], None], strict=True):
            if not isinstance(node, ast.Assign) or not isinstance(node.value, ast.Constant):
                continue
            if not isinstance(node.value.value, int | float) or isinstance(node.value.value, bool):
                continue
            while isinstance(after, ast.Assign):
                after = body[body.index(after) + 1]
            is_said = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            assert is_said, f"{path.relative_to(ROOM)}:{node.lineno}: why this number?"
