"""Methods of every result: plain types, a data frame, a figure, a report; and pickling."""

from __future__ import annotations

import copyreg
from collections.abc import Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from trihedron.answers import ask
from trihedron.records.frozen import Frozen, frozen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Library = Literal["polars", "pandas"]


class Presented(Frozen):
    """A record that can be shown; words, tables and figures are made on demand by ``report/``."""

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types, like ``--json`` of the command; non-finite numbers are None."""
        record: dict[str, Any] = ask("as_dict", self)
        return record

    def as_text(self) -> str:
        """The report as plain text, as ``print`` gives it."""
        return str(ask("as_text", self))

    def to_dataframe(self, library: Library = "polars") -> Any:
        """One row per parameter, pose, axis and term, or sample; units in the names.

        Raises
        ------
        ValueError
            When the library is neither polars nor pandas, or is not installed.
        """
        return ask("as_frame", self, library)

    def plot(self, name: str | None = None, *, ax: Axes | Sequence[Axes] | None = None) -> Figure:
        """A matplotlib figure of the report: the first, or the one of that name.

        Parameters
        ----------
        name : str, optional
            Which figure; the error for a wrong name lists the figures.
        ax : matplotlib Axes, or one for each panel
            Where to draw; a new figure when not given.

        Returns
        -------
        Figure
            ``.savefig("f.png")`` writes it; a notebook shows it.

        Raises
        ------
        ValueError
            When there is no figure of that name, it has another number of panels, or matplotlib is not installed.

        Examples
        --------
        >>> result.plot("residuals").savefig("residuals.png")
        """
        figure: Figure = ask("plot", self, name, ax=ax)
        return figure

    def _repr_html_(self) -> str:
        return str(ask("as_html", self))


class Printed(Presented):
    """A result whose ``print`` shows the report."""

    def __str__(self) -> str:
        return self.as_text()


# Pickle and deepcopy do not support read-only views of dictionaries without this.
copyreg.pickle(MappingProxyType, lambda mapping: (frozen, (dict(mapping),)))
