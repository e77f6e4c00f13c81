"""Text logs: the layout of their lines, the meaning of their cells, and the line of each row."""
