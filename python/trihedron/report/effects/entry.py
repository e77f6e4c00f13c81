"""Words about one effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True)
class EffectWords:
    """Words of the effect ``id``.

    ``mechanism`` completes "the model lacks this: ..."; ``experiment`` is the recording that separates it from other
    effects, ``experiment_at_rest`` the same for a log of one or two orientations. ``said`` are sentences about the
    accepted effect by case, with placeholders for values (``report/findings/wording.py``); without one the sentence is
    the mechanism with its strongest term. ``lines`` are the parts of placeholders ``{name:each}``.
    """

    id: str
    mechanism: str
    experiment: str = ""
    said: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    experiment_at_rest: str = ""
    lines: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
