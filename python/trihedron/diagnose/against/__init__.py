"""A given model compared with a recording: parameters first, then effects."""
