"""Changes a user's scenario file as a diagnosis requires; everything else is kept except comments on changed values."""

import os
from collections.abc import Collection, Mapping, Sequence
from importlib.resources import files
from itertools import dropwhile
from typing import Any

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Item

from trihedron.documents import read_text
from trihedron.errors import InputError
from trihedron.files.output import write_whole

TEMPLATE = files("trihedron.files").joinpath("template.toml").read_text(encoding="utf-8")
"""A scenario to begin with."""


def improved_scenario(
    path: str | os.PathLike[str],
    tables: Mapping[str, Mapping[str, Any]],
    effects: Sequence[tuple[str, Mapping[str, Any]]],
    removed: Collection[str] = (),
) -> str:
    """The text of a user's scenario file with new values.

    ``tables`` has values that replace those of the file: ``{"accelerometer": {"noise": {"N": [...]}}, ...}``.
    ``effects`` are (id, size), with the keys of ``[[effect]]``, and replace entries of the same id; those of the ids
    ``removed`` are removed.

    Raises ``ValueError`` when the file is not TOML.
    """
    text = read_text(path, "scenario file")
    try:
        document = tomlkit.parse(_under_own_head(text, os.path.basename(path)))
    except (TOMLKitError, RecursionError) as error:
        raise InputError(f"{path}: this is not a TOML file: {error}") from None
    for name, values in tables.items():
        if values:
            _merge(document, name, values)
    gone = {effect_id for effect_id, _ in effects} | set(removed)
    kept = [entry for entry in document.get("effect", []) if str(entry.get("id", "")) not in gone]
    if "effect" in document:
        del document["effect"]
    entries: AoT = tomlkit.aot()
    for entry in kept:
        entries.append(entry)
    for effect_id, size in effects:
        table = tomlkit.table()
        table.add("id", effect_id)
        for key, value in size.items():
            table.add(key, _item(value))
        entries.append(table)
    if len(entries):
        document.add("effect", entries)
    return tomlkit.dumps(document).rstrip("\n") + "\n"


def write_scenario(text: str, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write an improved scenario to a file. Raises ``InputError`` when the file exists and may not be replaced."""
    write_whole(path, text, overwrite=overwrite)


def _under_own_head(text: str, name: str) -> str:
    """The text with one new comment in place of those above its first key, which describe the old values."""
    rest = list(dropwhile(lambda line: not line.strip() or line.startswith("#"), text.splitlines(keepends=True)))
    return f"# {name}, with the values of a recording in place of its own (diagnose --improved).\n{''.join(rest)}"


def _merge(parent: Any, name: str, values: Mapping[str, Any]) -> None:
    is_new = name not in parent
    if is_new:
        parent.add(name, tomlkit.table())
    table = parent[name]
    for key, value in values.items():
        if isinstance(value, Mapping):
            _merge(table, key, value)
        else:
            item = _item(value)
            is_same = key in table and table[key] == item
            table[key] = item
            if not is_same:
                item.trivia.comment = item.trivia.comment_ws = ""
    if is_new:
        table.add(tomlkit.nl())


def _item(value: Any) -> Item:
    """TOML item of a number, text, or nested sequence; eight digits, which is finer than any uncertainty."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    item: Item = tomlkit.item(_rounded(value))
    return item


def _rounded(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_rounded(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.8g}") + 0.0  # avoids -0.0
    return value
