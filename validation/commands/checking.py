"""The command `robotball check`: a user's own model as it is, with a page and the file mended."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from robotball.engines.mujoco.user_model import UserModel
from robotball.errors import check_positive, mujoco_silent, named
from robotball.robot.drives import as_drive
from robotball.scene_files.scene_keys import ask
from robotball.user_model.robot_file import open_robot, starts_off

from ..check.ablate import Checked, check_model, motions_of
from ..check.observe import made_to_move
from ..check.say import difference, page_of, study_of
from ..options import AGREES, DISAGREES, OUT, Controls, Duration, File, Given
from ..output import progress_bar, writable_folder, write_text
from ..results import controls_of
from ..study import present


@dataclass(frozen=True)
class Check:
    """Say whether an MJCF or URDF robot rolls right as it is; if not, which setting is wrong.

    Example: robotball check mybot.xml
    """

    file: Positional[Annotated[Path, arg(metavar="FILE")]]
    """The MJCF or URDF file of the robot. It is not changed."""
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
        checked, notes = self.checked()
        study = study_of(checked, notes)
        picture, html = (self.out / f"{study.stem()}.{kind}" for kind in ("png", "html"))
        present(study, picture, self.json, None)
        write_text(html, page_of(study, checked, picture, motions_of(checked)))
        print(picture, html, sep="\n")
        if checked.needed:
            mended = self.out / f"{self.file.stem}-mended.xml"
            write_text(mended, checked.text)
            print(mended, *difference(checked), sep="\n")
        return AGREES if checked.agrees else DISAGREES

    @mujoco_silent()  # or MuJoCo writes its warnings into the current folder
    def checked(self) -> tuple[Checked, list[str]]:
        """Return the outcome of the check, and the lines to print before it."""
        robot = open_robot(self.file, self.shell)
        seconds = 10.0 if self.duration is None else self.duration
        given = controls_of(self.control)
        controls = {name: as_drive(value, seconds) for name, value in given.items()}
        user, moves = made_to_move(UserModel(robot, controls, self.keyframe))
        start = user.begin()
        with named(self.file):
            notes = [*robot.notes, *starts_off(robot, start), *moves]
        ask(self.file, user.scene(self.rolling or "classical", seconds))
        with progress_bar(1) as show:
            return check_model(user, self.rolling, seconds, self.accuracy, show), notes
