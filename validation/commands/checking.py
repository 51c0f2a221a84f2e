"""The command `robotball check`: a user's own model as it is, with a page and the file mended."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from robotball.engines.mujoco.user_model import UserModel
from robotball.errors import check_positive, mujoco_silent, named
from robotball.motion import Motion, versions
from robotball.robot.drives import as_drive
from robotball.scene_files.scene_keys import ask
from robotball.user_model.robot_file import open_robot, starts_off
from robotball.view.web import view_fragment, view_head

from ..options import AGREES, DISAGREES, OUT, Controls, Duration, File, Given
from ..output import progress_bar, writable_folder, write_text
from ..report import folded, page, paragraph, plain, table, text
from ..report import picture as figure
from ..results import controls_of
from ..studies import check
from ..study import Study, present


@dataclass(frozen=True)
class Check:
    """Say whether an MJCF or URDF robot rolls right as it is; if not, which setting is wrong.

    Example: robotball check mybot.xml
    """

    file: Positional[Annotated[Path, arg(metavar="FILE")]]
    """The MJCF or URDF file of the robot, of which nothing is overwritten."""
    shell: Annotated[Given[str], arg(metavar="NAME")] = None
    """The body or geom that rolls; the largest sphere if not given."""
    # Spelled out, as `--help` would load NumPy for the type that equations.py has.
    rolling: Given[Literal["rubber", "classical"]] = None
    """The rolling model; the nearer one if not given."""
    keyframe: Annotated[Given[str], arg(metavar="NAME")] = None
    """The keyframe to start at; the first one if not given."""
    control: Controls = ()
    accuracy: float = 1e-3
    """The path error to reach, over the path's length."""
    duration: Duration = None
    """Simulated time; 10 s if not given."""
    out: Path = OUT
    """Folder for the mended file, the page and the picture."""
    json: File = None
    """Also write what is found as JSON."""

    def run(self) -> int:
        check_positive("accuracy", self.accuracy, "")
        writable_folder(self.out)
        own, checked, notes = self.checked()
        study = check.study_of(own, checked, notes)
        picture, html = (self.out / f"{study.stem()}.{kind}" for kind in ("png", "html"))
        present(study, picture, self.json, None)
        write_text(html, _page_of(study, checked, picture, check.beside(own, checked)))
        print(picture, html, sep="\n")
        if checked.needed:
            mended = self.out / f"{self.file.stem}-mended.xml"
            write_text(mended, checked.text)
            print(mended, *check.difference(checked), sep="\n")
        return AGREES if checked.agrees else DISAGREES

    @mujoco_silent()  # or MuJoCo writes its warnings into the current folder
    def checked(self) -> tuple[UserModel, check.Checked, list[str]]:
        """Return the file's model, what is found of it, and words known before."""
        robot = open_robot(self.file, self.shell)
        seconds = 10.0 if self.duration is None else self.duration
        given = controls_of(self.control)
        controls = {name: as_drive(value, seconds) for name, value in given.items()}
        own, moves = check.moved(UserModel(robot, controls, self.keyframe))
        start = own.begin()
        with named(self.file):
            notes = [*robot.notes, *starts_off(robot, start), *moves]
        ask(self.file, own.scene(self.rolling or "classical", seconds))
        with progress_bar(1) as show:
            return own, check.check_model(own, self.rolling, seconds, self.accuracy, show), notes


def _page_of(study: Study, checked: check.Checked, picture: Path, motions: Sequence[Motion]) -> str:
    """Return the HTML page of a check, with its picture and a view of the motions."""
    lines = study.record["lines"] if study.record else [""]
    cells = [[column.text(row) for column in check.COLUMNS] for row in study.rows]
    body = [
        f"<h1>{text(study.scene)}</h1>",
        *map(paragraph, lines),
        figure(picture),
        "<h2>3-D view</h2>",
        view_fragment(motions),
        "<h2>What each change is worth</h2>",
        table([column.header for column in check.COLUMNS], cells, "words"),
        "<h2>The changes</h2>",
        f'<pre class="wide">{escape(chr(10).join(check.difference(checked)))}</pre>',
        folded("Versions", plain(versions()), short=True),
    ]
    return page(f"robotball: check of {study.scene}", body, view_head())
