"""Catalogues whose entries are the modules of a folder, without a list of their names."""

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def modules_of(package: str, path: Iterable[str]) -> list[ModuleType]:
    """Every module of a package (its ``__name__`` and ``__path__``), loaded, by name."""
    return [import_module(f"{package}.{found.name}") for found in iter_modules(path)]
