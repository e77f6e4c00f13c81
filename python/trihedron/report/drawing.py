"""Figures that are drawn when they are wanted: text and JSON never load matplotlib, and do without it."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, cast

from trihedron.errors import RefusedError

if TYPE_CHECKING:
    from trihedron.report.figures import ShownFigure


class NoFiguresError(RefusedError):
    """Figures were asked for where matplotlib is not installed."""


def later(room: str, name: str, *what: object, **how: object) -> partial[ShownFigure]:
    """A figure to be drawn by ``name`` of ``trihedron.report.<room>`` when it is called.

    Raises
    ------
    NoFiguresError
        (a ``ValueError``) when it is called and matplotlib is not installed.
    """
    return partial(_draw, room, name, *what, **how)


def _draw(room: str, name: str, *what: object, **how: object) -> ShownFigure:
    try:
        drawing = import_module(f"trihedron.report.{room}")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in {"matplotlib", "mpl_toolkits"}:
            raise
        raise NoFiguresError("figures need matplotlib, which is not installed: pip install matplotlib.") from None
    return cast("ShownFigure", getattr(drawing, name)(*what, **how))
