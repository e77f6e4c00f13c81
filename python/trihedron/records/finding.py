"""Findings: problems and remarks from a closed list of codes, each with its likely cause and the next action."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from numbers import Real
from types import MappingProxyType
from typing import Any, Protocol

from trihedron.answers import ask
from trihedron.records.checked import Checked
from trihedron.records.plain import Plain


class Severity(str, Enum):
    """Effect of a finding on the result.

    ``NOTE``: information, for example an assumed value. ``WARNING``: the result is usable, but less reliable than it
    looks. ``SERIOUS``: the result is not to be trusted (exit status 2 on the command line).
    """

    NOTE = "note"
    WARNING = "warning"
    SERIOUS = "serious"


@dataclass(frozen=True)
class Finding(Checked, Plain):
    """One problem or remark about a log or a result.

    Attributes
    ----------
    code : str
        Of the catalogue in ``report/findings``; it keeps its meaning from version to version.
    severity : Severity
        ``note``, ``warning`` or ``serious`` (not to be trusted).
    seen, cause, action : str
        One sentence with number and place; the likely cause; what to do next.
    numbers : mapping of name to float
        The figures of the sentence for machines (SI units, the unit ends the key: ``gap_s``).

    Examples
    --------
    >>> all(finding.seen.endswith(".") for finding in result.findings)
    True
    """

    code: str
    severity: Severity
    seen: str
    cause: str = ""
    action: str = ""
    numbers: MappingProxyType[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def of(
        cls,
        code: str,
        case: str = "",
        /,
        *,
        severity: Severity | None = None,
        numbers: Mapping[str, float] | None = None,
        **values: Any,
    ) -> Finding:
        """A finding by code and values (SI); severity and sentences are from the catalogue (``report/findings``).

        ``case`` selects between the sentences of one code, ``severity`` replaces the default where the catalogue allows
        two, ``numbers`` are figures for machines whose names depend on the recording. A stage writes no sentences: they
        are looked up here.

        Raises KeyError when the catalogue lacks the case, or a placeholder of its sentences has no value.
        """
        severity, seen, cause, action = ask("words_of", code, case, severity, values)
        plain = {name: float(v) for name, v in values.items() if isinstance(v, Real) and not isinstance(v, bool)}
        # An infinite value or NaN means not estimated, and JSON cannot hold it.
        figures = {name: v for name, v in (plain | dict(numbers or {})).items() if math.isfinite(v)}
        return cls(code, severity, seen, cause, action, MappingProxyType(figures))

    def __str__(self) -> str:
        return f"{self.severity.value}: {self.seen}" + (f" {self.action}" if self.action else "")


class HasFindings(Protocol):
    @property
    def findings(self) -> tuple[Finding, ...]: ...


class Judged:
    """A record whose findings decide whether it is to be trusted."""

    @property
    def is_trustworthy(self: HasFindings) -> bool:
        """True without a serious finding."""
        return not any(finding.severity is Severity.SERIOUS for finding in self.findings)
