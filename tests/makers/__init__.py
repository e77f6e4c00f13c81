"""Text logs as their makers' programs write them, by the name of their generator."""

from makers import boards, collections, consoles, instruments, more_layouts, phones
from makers.layout import LAYOUTS, Layout

__all__ = ["LAYOUTS", "Layout", "boards", "collections", "consoles", "instruments", "more_layouts", "phones"]
