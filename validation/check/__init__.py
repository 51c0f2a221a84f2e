"""Check a user's own robot file: `observe` it, `propose` changes, `ablate` them, `say` the result.

`ablate.check_model` runs the first three.
"""
