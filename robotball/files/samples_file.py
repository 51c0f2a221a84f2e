"""Samples of a command from a table of numbers."""

from pathlib import Path

from robotball.errors import InputError
from robotball.files.table_file import read_table
from robotball.rates import Samples

TIME, VALUE = ("s",), ("rad/s", "rad", "N m", "Nm", "N*m", "N·m")


def read_samples(path: Path) -> Samples:
    """The samples of a file of two columns, a time [s] and a value.

    Raises InputError, with the file, where it holds none, or a unit that is not SI's.
    """
    table = read_table(path)
    if len(table.columns) != 2:
        raise InputError(
            f"{path}: samples take two columns, time and value, not {', '.join(table.columns)}"
        )
    for name, known in zip(table.columns, (TIME, VALUE), strict=True):
        if (unit := table.units.get(name)) and unit not in known:
            raise InputError(f"{path}: {name} is in {unit}; samples take {', '.join(known[:3])}")
    times, values = (tuple(column.tolist()) for column in table.columns.values())
    try:
        return Samples(times=times, values=values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
