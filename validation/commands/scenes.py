"""The commands `scenes` and `export`: what scenes there are, and a scene for other programs."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .. import options


def scenes() -> int:
    """List the scenes of the catalog.

    Example: robotball scenes
    """
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from robotball.scene_files.scene_file import heads

    from ..output import print_whole

    table = Table("scene", "rolling", "duration", "title", box=box.SIMPLE_HEAD)
    for name, head in heads().items():
        table.add_row(name, head["rolling"], f"{head['duration']:g} s", escape(head["title"]))
    print_whole(table, Console())
    return options.AGREES


def export(
    scene: options.SceneName,
    /,
    *,
    control: options.Controls = (),
    out: Annotated[Path | None, Parameter(metavar="DIR")] = None,
    preset: options.PresetName = "balanced",
    duration: options.Duration = None,
) -> int:
    """Print a scene as MJCF, or write it as MJCF and URDF for other simulators.

    'robotball judge' compares the other simulator's trajectory with the equations.

    Example: robotball export fig12 --out fig12-export

    Parameters
    ----------
    out
        Write all formats into this folder instead of printing the MJCF.
    preset
        The settings that the MJCF has.
    """
    from robotball import export_scene
    from robotball import preset as settings_of
    from robotball.engines.mujoco.mjcf_export import write_model

    from ..output import writable_folder, write_text
    from ..results import controlled

    ball, settings = controlled(scene, control), settings_of(preset)
    ball = replace(ball, duration=options.seconds_of(duration, False, ball))
    if out is None:
        model = write_model(ball, settings)
        print(model.xml, end="")
        if model.needs is not None:
            print(f"robotball: {model.needs}; --out DIR writes it", file=sys.stderr)
        return options.AGREES
    folder = writable_folder(out)
    written = export_scene(ball, folder)
    if not ball.plane_moves:  # MJCF cannot say how a plane moves
        for name, text in write_model(ball, settings).files.items():
            write_text(folder / name, text)
            written.append(folder / name)
    print(*sorted(written), sep="\n")
    return options.AGREES
