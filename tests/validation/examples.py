"""The example that a command's `--help` prints, as what to run."""

import re

from validation.cli import class_of


def example(name: str) -> str:
    """Return the words behind `robotball` in it."""
    found = re.findall(r"^ *Example: robotball (.*)$", class_of(name).__doc__ or "", re.MULTILINE)
    (arguments,) = found
    return str(arguments)
