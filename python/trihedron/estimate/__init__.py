"""Estimation: one file or folder per procedure, records in and records out."""
