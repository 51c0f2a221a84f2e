"""The command `check`: test a robot's own model, with a page and a mended file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from .. import options

if TYPE_CHECKING:
    from ..check.ablate import Checked

_ACCURACY = 1e-3  # relative path error that counts as agreement


def check(
    file: Path,
    /,
    *,
    shell: Annotated[str | None, Parameter(metavar="NAME")] = None,
    rolling: Literal["rubber", "classical"] | None = None,
    keyframe: Annotated[str | None, Parameter(metavar="NAME")] = None,
    control: options.Controls = (),
    accuracy: Annotated[float, Parameter(metavar="ERROR")] = _ACCURACY,
    duration: options.Seconds | None = None,
    out: options.Out = options.OUT,
    json: options.JsonFile = None,
) -> int:
    """Say whether an MJCF or URDF robot rolls as it should; if not, which setting is wrong.

    Writes a mended file, a page and a picture. Your own file is not changed.

    Example: robotball check mybot.xml

    Parameters
    ----------
    file
        The MJCF or URDF file of the robot.
    shell
        The body or geom that rolls. Default: the largest sphere.
    rolling
        The rolling model. Default: the one that is nearer.
    keyframe
        The keyframe to start at. Default: the first one.
    accuracy
        Largest path error, relative to the path length, that counts as agreement.
    duration
        Simulated time. Default: 10 s.
    """
    from robotball.errors import check_positive

    from ..check.ablate import motions_of
    from ..check.say import difference, page_of, study_of
    from ..output import writable_folder, write_text
    from ..study import present

    check_positive("accuracy", accuracy, "")
    writable_folder(out)
    checked, notes = checked_robot(file, shell, rolling, keyframe, control, accuracy, duration)
    study = study_of(checked, notes)
    picture, html = (out / f"{study.stem()}.{kind}" for kind in ("png", "html"))
    present(study, picture, json, None)
    write_text(html, page_of(study, checked, picture, motions_of(checked)))
    print(picture, html, sep="\n")
    if checked.needed:
        mended = out / f"{file.stem}-mended.xml"
        write_text(mended, checked.text)
        print(mended, *difference(checked), sep="\n")
    return options.AGREES if checked.agrees else options.DISAGREES


def checked_robot(
    file: Path,
    shell: str | None = None,
    rolling: Literal["rubber", "classical"] | None = None,
    keyframe: str | None = None,
    control: tuple[str, ...] = (),
    accuracy: float = _ACCURACY,
    duration: float | None = None,
) -> "tuple[Checked, list[str]]":
    """Return the outcome of the check, and the lines to print before it."""
    from robotball.engines.mujoco.user_model import UserModel
    from robotball.errors import mujoco_silent, named
    from robotball.robot.drives import as_drive
    from robotball.scene_files.scene_keys import ask
    from robotball.user_model.robot_file import open_robot, starts_off

    from ..check.ablate import check_model
    from ..check.observe import made_to_move
    from ..output import progress_bar
    from ..results import controls_of

    with mujoco_silent():  # or MuJoCo writes its warnings into the current folder
        robot = open_robot(file, shell)
        seconds = 10.0 if duration is None else duration
        controls = {name: as_drive(value, seconds) for name, value in controls_of(control).items()}
        user, moves = made_to_move(UserModel(robot, controls, keyframe))
        start = user.begin()
        with named(file):
            notes = [*robot.notes, *starts_off(robot, start), *moves]
        ask(file, user.scene(rolling or "classical", seconds))
        with progress_bar(1) as show:
            return check_model(user, rolling, seconds, accuracy, show), notes
