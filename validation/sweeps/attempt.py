"""What a worker does with a cell: the work, or the reason why it failed, as a line."""

from collections.abc import Mapping

from validation.sweeps.cells import Cell, Work, to_line
from validation.sweeps.limit import TookTooLong, killed_after, limited, too_long


def attempt(work: Work, cell: Cell, limit: float | None, own_process: bool) -> str:
    """The result's line; whatever the work raises is its failure.

    limit: in s; own_process: no other cell runs in this process, so it may be killed where the
    work does not heed the limit.
    """
    try:
        with killed_after(limit if own_process else None), limited(limit):
            record = work(cell)
        if not isinstance(record, Mapping):
            raise TypeError(f"a record must be a mapping, not {type(record).__name__}")
        return to_line(cell, record, None)
    except TookTooLong:
        assert limit is not None
        return to_line(cell, None, too_long(limit))
    except (Exception, SystemExit) as error:
        return to_line(cell, None, reason(error))


def reason(error: BaseException) -> str:
    """An exception in one line."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__
