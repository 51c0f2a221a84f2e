"""Sweeps: one function over many cells, in many processes, with every result on disk at once."""

from validation.sweeps.cells import Cell, Result, Work, write_table
from validation.sweeps.run import sweep

__all__ = ["Cell", "Result", "Work", "sweep", "write_table"]
