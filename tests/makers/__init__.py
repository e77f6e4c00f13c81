"""Text logs as their makers' programs write them, by the name of their generator."""

from makers import boards, instruments, more_layouts, phones
from makers.layout import LAYOUTS, Layout

__all__ = ["LAYOUTS", "Layout", "boards", "instruments", "more_layouts", "phones"]
