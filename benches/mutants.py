"""Does the suite notice a wrong line? One sign, comparison, constant or unit is changed at random, then tests are run.

    python benches/mutants.py --count 40 --seed 1              # tests that are nearest to the changed file
    python benches/mutants.py --count 40 --seed 1 --whole      # survivors are then shown to the whole suite
    python benches/mutants.py --only rust --count 5            # needs cargo; each is built anew
    python benches/mutants.py --at python/trihedron/units.py:14 --count 4

Works on a copy of the checkout. The nearest tests are run: those that name the file's module, then those of its stage.
A change of a sentence, of a default nobody takes, or of speed alone is not told from one that matters: read what lives.
"""

from __future__ import annotations

import argparse
import ast
import io
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tokenize
from dataclasses import dataclass
from functools import partial
from pathlib import Path

ROOT = Path(__file__).parents[1]
COMPARED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
SIGNS = {"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*="}
UNITS = {
    "radians": "degrees", "degrees": "radians", "deg2rad": "rad2deg", "rad2deg": "deg2rad",
    "to_radians": "to_degrees", "to_degrees": "to_radians",
}  # fmt: skip
RUST_TOKEN = re.compile(
    r"(?<= )(<=|>=|==|!=|[<>+*/-]=?)(?= )|\b\d[\d_]*(?:\.\d+)?(?:e-?\d+)?\b|\bto_(?:radians|degrees)\b"
)
NEAREST = 6
"""Test files that a mutant is shown to before it counts as a survivor of the short way."""


@dataclass(frozen=True)
class Mutant:
    path: Path
    line: int
    column: int
    old: str
    new: str

    def text(self, source: str) -> str:
        lines = source.splitlines(keepends=True)
        row = lines[self.line - 1]
        lines[self.line - 1] = row[: self.column] + self.new + row[self.column + len(self.old) :]
        return "".join(lines)

    def __str__(self) -> str:
        return f"{self.path}:{self.line}:{self.column} {self.old} -> {self.new}"


def other(word: str) -> str | None:
    """What stands in the place of a word: the other comparison, sign or unit; a constant that is another."""
    for table in (COMPARED, SIGNS, UNITS):
        if word in table:
            return table[word]
    if re.fullmatch(r"\d[\d_]*", word):
        return str(int(word) + 1)
    if re.fullmatch(r"\d[\d_]*\.?\d*(e-?\d+)?", word):
        return repr(1.3 * float(word)) if float(word) else "0.1"
    return None


def of_python(path: Path) -> list[Mutant]:
    """Every place of a file but docstrings, annotations, imports and the middle of strings."""
    source = (ROOT / path).read_text()
    plain = {n.lineno for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Import | ast.ImportFrom)}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            plain |= set(range(node.lineno, node.body[0].lineno))
    found = []
    for one in tokenize.generate_tokens(io.StringIO(source).readline):
        is_word = one.type in (tokenize.OP, tokenize.NUMBER) or one.string in UNITS
        if is_word and one.start[0] not in plain and (new := other(one.string)):
            # A star before an argument is no product.
            if one.string in "*+-" and re.search(r"[(,\[{=:]\s*$", one.line[: one.start[1]]) and one.string != "-":
                continue
            found.append(Mutant(path, *one.start, one.string, new))
    return found


def of_rust(path: Path) -> list[Mutant]:
    found = []
    for k, line in enumerate((ROOT / path).read_text().splitlines(), 1):
        if re.match(r"\s*(//|use |#|pub mod|mod |pub fn|fn |impl|const [A-Z_]+: \[)", line) or '"' in line:
            continue
        for one in RUST_TOKEN.finditer(line):
            # A width of a type and an index of a field are no constants.
            if one[0].isdigit() and re.search(r"[\w.;\[]$", line[: one.start()].rstrip()):
                continue
            if new := other(one[0]):
                found.append(Mutant(path, k, one.start(), one[0], new))
    return found


def drawn(count: int, seed: int, only: str) -> list[Mutant]:
    """Files in proportion to their lines."""
    files = [p.relative_to(ROOT) for p in (ROOT / "python").rglob("*.py") if only != "rust"]
    files += [p.relative_to(ROOT) for p in (ROOT / "rust").rglob("*.rs") if only != "python"]
    rng = random.Random(seed)
    weights = [len((ROOT / p).read_text().splitlines()) for p in sorted(files)]
    out: list[Mutant] = []
    while len(out) < count:
        (path,) = rng.choices(sorted(files), weights)
        places = (of_python if path.suffix == ".py" else of_rust)(path)
        if places and path.name != "__init__.py":
            out.append(rng.choice(places))
    return out


def nearest(path: Path) -> list[str]:
    """Test files by how near they are: their names and their texts name the module, its folder, its stage."""
    parts = [p for p in path.with_suffix("").parts if p not in ("python", "trihedron", "rust", "mod", "__init__")]
    dotted = ".".join(parts)
    score = {}
    for test in sorted((ROOT / "tests").glob("test_*.py")):
        text = test.read_text()
        names = {word for part in parts for word in part.split("_") if len(word) > 2}
        near = 8.0 * (f"trihedron.{dotted}" in text) + 3.0 * sum(f"_{name}" in test.stem for name in names)
        near += 2.0 * sum(f".{part}" in text for part in parts) + (path.parts[0] == "rust") * ("_core" in text)
        score[test.name] = near - 1e-5 * len(text)
    return [f"tests/{name}" for name in sorted(score, key=lambda n: -score[n])]


def is_noticed(mutant: Mutant, copy: Path, tests: list[str], seconds: float) -> str:
    """The test that failed, or an empty string. A build that fails, or never ends, has been noticed."""
    target = copy / mutant.path
    source = target.read_text()
    target.write_text(mutant.text(source))
    environment = os.environ | {"PYTHONPATH": str(copy / "python"), "OPENBLAS_NUM_THREADS": "1"}
    core = copy / "python/trihedron/_core.abi3.so"
    kept = core.read_bytes()
    try:
        if mutant.path.suffix == ".rs":
            build = ["cargo", "build", "--release", "--features", "python,pyo3/extension-module"]
            built = subprocess.run(build, cwd=copy, capture_output=True, text=True, check=False)
            if built.returncode:
                return "the compiler"
            folder = Path(os.environ.get("CARGO_TARGET_DIR", copy / "target"))
            core.write_bytes((folder / "release/libtrihedron.so").read_bytes())
        words = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-q", "-p", "no:cacheprovider", *tests]
        # Seconds of processor time, which other work on the machine does not lengthen.
        limit = partial(resource.setrlimit, resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
        done = subprocess.run(
            words, cwd=copy, env=environment, capture_output=True, text=True, preexec_fn=limit, check=False
        )
        if done.returncode < 0:
            return "the clock"
    finally:
        target.write_text(source)
        core.write_bytes(kept)
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return "" if done.returncode == 0 else (failed[0] if failed else "collection")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=["python", "rust"], default="")
    parser.add_argument("--at", help="FILE:LINE, every place of it up to COUNT")
    parser.add_argument("--whole", action="store_true", help="show survivors to the whole suite")
    parser.add_argument(
        "--seconds", type=float, default=300.0, help="of processor time, after which a mutant counts as noticed"
    )
    asked = parser.parse_args()
    if asked.at:
        path, line = asked.at.split(":")
        every = (of_python if path.endswith(".py") else of_rust)(Path(path))
        mutants = [one for one in every if one.line == int(line)][: asked.count]
    else:
        mutants = drawn(asked.count, asked.seed, asked.only)
    noticed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns("target", ".git", "__pycache__", ".hypothesis"))
        for mutant in mutants:
            began, tests = time.perf_counter(), nearest(mutant.path)
            by = is_noticed(mutant, copy, tests[:NEAREST], asked.seconds)
            if not by and asked.whole:
                by = is_noticed(mutant, copy, tests[NEAREST:], 4.0 * asked.seconds)
            noticed += bool(by)
            print(f"{'noticed' if by else 'LIVES  '} {mutant}  {by} {time.perf_counter() - began:.0f} s", flush=True)
    print(f"{noticed} of {len(mutants)} noticed (seed {asked.seed})")


if __name__ == "__main__":
    main()
