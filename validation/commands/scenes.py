"""The command `robotball scenes`."""

from dataclasses import dataclass

from validation.commands.arguments import AGREES


@dataclass(frozen=True)
class Scenes:
    """The catalog: every scene that comes with robotball.

    Example: robotball scenes
    """

    def run(self) -> int:
        from rich import box
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from robotball.files.scene_file import entries
        from validation.output import print_whole

        table = Table("scene", "rolling", "duration", "title", box=box.SIMPLE_HEAD)
        for each in entries():
            table.add_row(each.name, each.rolling, f"{each.duration:g} s", escape(each.title))
        print_whole(table, Console())
        return AGREES
