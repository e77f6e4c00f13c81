"""Text logs: what their lines look like, what their cells say, and which line each row came from."""
