"""Text logs: what their lines look like, what their cells say, and which line each row came from."""

from trihedron.read.text.blocks import compression_of, open_binary
from trihedron.read.text.open import read_text

__all__ = ["compression_of", "open_binary", "read_text"]
