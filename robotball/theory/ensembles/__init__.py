"""The equations compiled: one step as straight-line code, marched in parallel lanes."""
