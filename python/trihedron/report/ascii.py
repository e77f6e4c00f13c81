"""Text for terminals and files with ASCII only."""

import re
import unicodedata

_RAISED = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")
_WORDS = {
    "′": "'", "″": '"', "±": "+/-", "−": "-", "–": "-", "—": "-", "×": "x", "·": "*", "°": "deg",
    "→": "->", "←": "<-", "…": "...", "─": "-", "│": "|", "≤": "<=", "≥": ">=", "≈": "~", "≠": "!=", "∞": "inf",
    "Δ": "d", "Σ": "sum", "α": "alpha", "β": "beta", "θ": "theta", "λ": "lambda", "π": "pi", "ρ": "rho", "σ": "sigma",
    "τ": "tau", "φ": "phi", "χ": "chi", "ψ": "psi", "ω": "w", "Ω": "Ohm", "µ": "u", "μ": "u", "•": "*",
    "‘": "'", "’": "'", "“": '"', "”": '"',
    "\u00a0": " ", "\u202f": " ",
    "↑": "^", "↓": "v", "█": "#", "╭": "+", "╮": "+", "╰": "+", "╯": "+", "━": "=", "╸": "=", "╺": "-",
}  # fmt: skip
_TABLE = str.maketrans(_WORDS)


def ascii_of(text: str) -> str:
    """The text in ASCII: ``10⁻³`` is ``10^-3``, ``±`` is ``+/-``, ``°/s`` is ``deg/s``; letters lose their accents.

    Examples
    --------
    >>> ascii_of("σ = 1.5 ± 0.2 × 10⁻³ m/s²")
    'sigma = 1.5 +/- 0.2 x 10^-3 m/s^2'
    """
    if text.isascii():
        return text
    text = re.sub("[⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda found: "^" + found[0].translate(_RAISED), text)
    text = re.sub(r"√(\w+)", r"sqrt(\1)", text).translate(_TABLE)
    bare = {c: unicodedata.normalize("NFKD", c).encode("ascii", "ignore").decode() for c in set(text)}
    return "".join(bare[c] or ("" if unicodedata.combining(c) else "?") for c in text)
