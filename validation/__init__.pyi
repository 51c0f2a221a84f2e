"""The names of `validation`, each from its home; loaded when they are first used."""

from .comparison.agreement import Agreement, compare

__all__ = ["Agreement", "compare"]
