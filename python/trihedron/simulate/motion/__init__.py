"""Motion: steps that people write, attitudes, and the plan that the kernel evaluates."""
