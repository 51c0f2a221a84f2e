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

        from robotball import catalog, load_scene

        table = Table("scene", "rolling", "duration", "title")
        for name in catalog():
            scene = load_scene(name)
            table.add_row(name, scene.rolling, f"{scene.duration:g} s", escape(scene.title))
        Console().print(table)
        return AGREES
