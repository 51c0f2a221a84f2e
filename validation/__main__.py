"""The `robotball` command as a process; `python -m validation` is the same.

The processes of a command import this module, so it imports little.
"""

import sys
import traceback

from validation.endings import ended_by_signals, open_closed

DEFECT = 3


def main() -> None:
    """Run the command, and exit with its status; with 3 where robotball itself is wrong."""
    open_closed()
    with ended_by_signals() as signals:
        from validation.cli import main as command

        try:
            command()
        except Exception:
            if not signals:
                traceback.print_exc()
            sys.exit(DEFECT)


if __name__ == "__main__":
    main()
