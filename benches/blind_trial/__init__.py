"""Blind trial of the diagnosis: recordings with a sealed flaw (draw, foreign), and how answers are scored."""
