"""The validation layer: both engines' motions compared, and the studies around that."""

from validation.comparison.agreement import Agreement, compare

__all__ = ["Agreement", "compare"]
