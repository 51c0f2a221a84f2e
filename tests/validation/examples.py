"""The example in the `--help` of a command."""

import re

from cyclopts import App

from validation.cli import FAMILIES, application

COMMANDS = [
    f"{name} {each}" if name in FAMILIES else each
    for name, app in application().resolved_commands().items()
    for each in (app if name in FAMILIES else [name])
    if each.isalpha()
]


def command(name: str) -> App:
    """Return a command of one word or two."""
    found = application()
    for word in name.split():
        found = found[word]
    return found


def example(name: str) -> str:
    """Return the words behind `robotball` in it."""
    found = re.findall(r"^ *Example: robotball (.*)$", command(name).help, re.MULTILINE)
    (arguments,) = found
    return str(arguments)
