"""The example in the `--help` of a command."""

import re

from validation.cli import class_of


def example(name: str) -> str:
    """Return the arguments of the example, without `robotball`."""
    found = re.findall(r"^ *Example: robotball (.*)$", class_of(name).__doc__ or "", re.MULTILINE)
    (arguments,) = found
    return str(arguments)
