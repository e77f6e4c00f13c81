"""trihedron."""
