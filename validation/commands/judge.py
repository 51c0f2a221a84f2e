"""The command `robotball judge`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, UseAppendAction, arg

from validation.commands.arguments import AGREES, DISAGREES, File, SceneName, check_files


@dataclass(frozen=True)
class Judge:
    """Say how far anybody's trajectory of a scene is off, and which mistake explains that.

    docs/trajectories.md has the columns; `robotball export` writes what an engine needs.

    Example: robotball export fig12 --to a; robotball judge fig12 a/reference.csv
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    files: Positional[Annotated[tuple[Path, ...], arg(metavar="FILE...")]]
    """CSV, NPZ or Parquet files with t,x,y,qw,qx,qy,qz; several with different steps give the
    order of convergence."""
    timestep: UseAppendAction[Annotated[tuple[str, ...], arg(metavar="SECONDS,…")]] = ()
    """The engine's step in each file; else the one in its header, or the interval of its
    samples."""
    tolerance: Annotated[float, arg(metavar="ERROR")] = 1e-2
    """The errors that agree: of path, momentum and hinges' rates, relative; of attitude [rad]."""
    every: bool = False
    """Show every mistake that was tried, not the two best of each kind."""
    json: File = None
    """Also write the judgement with all that was tried."""

    def run(self) -> int:
        from rich.console import Console

        from robotball import InputError, load_scene
        from robotball.errors import check_positive
        from validation.output import progress_bar, write_record
        from validation.studies.judge import judge, record, show

        if not self.files:
            raise InputError("judge needs a file with a trajectory: t,x,y,qw,qx,qy,qz")
        check_positive("tolerance", self.tolerance, "")
        check_files(self.json)
        scene = load_scene(self.scene)
        with progress_bar(1) as bar:
            judgement = judge(
                scene,
                self.files,
                timesteps=self._timesteps(),
                tolerance=self.tolerance,
                progress=lambda part: bar(part, f"{scene.name}: judging"),
            )
        write_record(self.json, record(judgement))
        show(judgement, Console(), self.every)
        return AGREES if judgement.agrees else DISAGREES

    def _timesteps(self) -> list[float]:
        from robotball import InputError
        from robotball.errors import check_positive
        from validation.commands.arguments import listed

        steps = []
        for text in listed(self.timestep):
            try:
                steps.append(float(text))
            except ValueError:
                raise InputError(f"a timestep must be a number of seconds, not {text!r}") from None
            check_positive("timestep", steps[-1], "s")
        return steps
