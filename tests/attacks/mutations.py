"""Damage to files: what copying, editing, and malice do to them. Every function takes a generator and is repeatable."""

import copy
import json
import re

import numpy as np

TOKENS = [
    *(b"nan", b"inf", b"-inf", b"1e999", b"-1e-300", b"0", b"-1", b"true", b"null", b'""', b"[]", b"{}", b'"x"'),
    *(b"9" * 400, b"[" * 200, b"{" * 50, b"\x00", b"\xff\xfe", b"\x1b[2J\x1b]0;x\x07", b"\xe2\x80\xae", b"\r", b"\n\n"),
    *(b'"', b"'", b"#", b"%", b"//", b",", b";", b"\t", b"=", b"[[effect]]", b"1_000", b"0x1F", b"1e", b"--5", b"1,5"),
]
VALUES = [
    *(None, True, False, 0, -1, 1.5, 1e300, -1e-300, 10**20, 10**399, "", "x", "\x1b[31m", "\x00", [], {}, [[]]),
    *([1, 2, 3], [[1, 0, 0]] * 3, {"a": 1}, [None] * 3, [float("1e308")] * 9, "9" * 50, ["x"]),
]


def of_bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """One to four accidents to a file of any kind."""
    for _ in range(int(rng.integers(1, 5))):
        n = max(len(data), 1)
        a, b = sorted(int(v) for v in rng.integers(0, n + 1, 2))
        kind = rng.integers(9)
        if kind == 0:
            flipped = bytearray(data or b"x")
            for at in rng.integers(0, len(flipped), int(rng.integers(1, 9))):
                flipped[at] ^= 1 << int(rng.integers(8))
            data = bytes(flipped)
        elif kind == 1:
            data = data[:a] + data[b:]
        elif kind == 2:
            data = data[:b] + data[a:]
        elif kind == 3:
            data = data[:a]
        elif kind == 4:
            data = data[:a] + TOKENS[int(rng.integers(len(TOKENS)))] + data[a:]
        elif kind == 5:
            data = data[:a] + TOKENS[int(rng.integers(len(TOKENS)))] + data[min(a + 3, len(data)) :]
        elif kind == 6:
            data = data[:a] + rng.bytes(int(rng.integers(1, 40))) + data[b:]
        elif kind == 7:
            lines = data.split(b"\n")
            i, j = rng.integers(0, len(lines), 2)
            lines[i], lines[j] = lines[j], lines[i]
            data = b"\n".join(lines)
        else:
            data = _number(rng, data)
        data = data[:2_000_000]
    return data


def _number(rng: np.random.Generator, data: bytes) -> bytes:
    """Another value in the place of one of the numbers."""
    found = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?", data[:200_000]))
    if not found:
        return data
    at = found[int(rng.integers(len(found)))]
    return data[: at.start()] + TOKENS[int(rng.integers(len(TOKENS)))] + data[at.end() :]


def of_json(rng: np.random.Generator, data: bytes) -> bytes:
    """Another value, another key, or none, somewhere in a document."""
    document = json.loads(data)
    for _ in range(int(rng.integers(1, 4))):
        node = document
        while True:
            places = list(node) if isinstance(node, dict) else list(range(len(node)))
            if not places:
                break
            place = places[int(rng.integers(len(places)))]
            child = node[place]
            if isinstance(child, dict | list) and child and rng.random() < 0.8:
                node = child
                continue
            kind = rng.random()
            if kind < 0.15:
                del node[place]
            elif kind < 0.25 and isinstance(node, dict):
                node[f"{place}x"] = node.pop(place)
            elif kind < 0.3 and isinstance(node, list):
                node.append(child)
            else:
                node[place] = copy.deepcopy(VALUES[int(rng.integers(len(VALUES)))])
            break
    return json.dumps(document).encode()
