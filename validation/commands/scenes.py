"""The command `robotball scenes`."""

from dataclasses import dataclass

from validation.commands.arguments import (
    AGREES,
)


@dataclass(frozen=True)
class Scenes:
    """The catalog: every scene that comes with robotball."""

    def run(self) -> int:
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from robotball.files.catalog import entries

        table = Table("scene", "rolling", "duration", "title")
        for each in entries():
            table.add_row(each.name, each.rolling, f"{each.duration:g} s", escape(each.title))
        Console().print(table)
        return AGREES
