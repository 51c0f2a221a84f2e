"""Check a user's own robot file: `observe` it, `propose` changes, `ablate` them, `say` the result.

`check` runs the four in this order; `unusual` lists numbers that the author may not have meant.
"""
