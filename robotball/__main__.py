"""`python -m robotball`: the installed command, which a layer above this library brings."""

from importlib.metadata import entry_points

if __name__ == "__main__":
    command = next(iter(entry_points(group="console_scripts", name="robotball")))
    command.load()()
