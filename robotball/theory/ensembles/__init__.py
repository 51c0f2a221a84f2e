"""The compiled equations: a step is straight-line code, and orbits march in parallel lanes."""
