"""Recordings as people make them: unlike hand paths, small faults everywhere, one flaw; no formula of the tool."""
