"""Numbers that once were wrong with confidence, asked as a user asks: logs from a generator of its own."""
