"""Sweeps: one function over many cells, in many processes, with every result on disk at once."""

from validation.sweeps.cells import Cell, Result, Work
from validation.sweeps.run import sweep
from validation.sweeps.table import write_table

__all__ = ["Cell", "Result", "Work", "sweep", "write_table"]
