"""Motion: steps of a session, attitudes, and the plan that the Rust kernel evaluates."""
