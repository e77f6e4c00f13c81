"""Figures by matplotlib, imported on demand: text and JSON work without it."""

from importlib import import_module
from types import ModuleType

from trihedron.errors import InputError
from trihedron.report.document import Picture


class NoFiguresError(InputError):
    """Figures are requested, but matplotlib is not installed."""


def figures() -> ModuleType:
    """:mod:`trihedron.report.figures`, the only module that imports matplotlib.

    Raises
    ------
    NoFiguresError
        (a ``ValueError``) when matplotlib is not installed.
    """
    try:
        return import_module("trihedron.report.figures")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in {"matplotlib", "mpl_toolkits"}:
            raise
        raise NoFiguresError("figures need matplotlib, which is not installed: pip install matplotlib.") from None


def png_of(picture: Picture) -> bytes:
    """A figure as the bytes of a PNG file; raises as :func:`figures` does."""
    library = figures()
    made: bytes = library.png(library.draw_chart(picture.chart))
    return made
