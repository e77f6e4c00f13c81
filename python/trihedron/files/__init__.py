"""Readers and writers of trihedron's own files, exports to other programs, and writing of files in one step."""
