"""The command `robotball engines`."""

from dataclasses import dataclass

from validation.commands.arguments import AGREES


@dataclass(frozen=True)
class Engines:
    """List the engines that can roll a scene, with their presets.

    Example: robotball engines
    """

    def run(self) -> int:
        from rich import box
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from robotball import InputError, engine_named, engine_names
        from validation.output import print_whole

        table = Table("engine", "name", "version", "presets", box=box.SIMPLE_HEAD)
        for key in engine_names():
            try:
                each = engine_named(key)
            except InputError as error:
                table.add_row(escape(key), "-", "-", escape(str(error)))
            else:
                label, presets = each.label, ", ".join(each.presets)
                table.add_row(*map(escape, (key, label.name, label.version, presets)))
        print_whole(table, Console())
        return AGREES
