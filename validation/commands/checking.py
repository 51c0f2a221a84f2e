"""The command `check`: a user's own model as it is, with a page and the file mended."""

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from .. import options

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotball.engines.mujoco.user_model import UserModel
    from robotball.motion import Motion

    from ..studies.check import Checked
    from ..study import Study

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

    from ..output import writable_folder, write_text
    from ..studies import check as work
    from ..study import present

    check_positive("accuracy", accuracy, "")
    writable_folder(out)
    own, checked, notes = checked_robot(file, shell, rolling, keyframe, control, accuracy, duration)
    study = work.study_of(own, checked, notes)
    picture, html = (out / f"{study.stem()}.{kind}" for kind in ("png", "html"))
    present(study, picture, json, None)
    write_text(html, _page_of(study, checked, picture, work.beside(own, checked)))
    print(picture, html, sep="\n")
    if checked.needed:
        mended = out / f"{file.stem}-mended.xml"
        write_text(mended, checked.text)
        print(mended, *work.difference(checked), sep="\n")
    return options.AGREES if checked.agrees else options.DISAGREES


def checked_robot(
    file: Path,
    shell: str | None = None,
    rolling: Literal["rubber", "classical"] | None = None,
    keyframe: str | None = None,
    control: tuple[str, ...] = (),
    accuracy: float = _ACCURACY,
    duration: float | None = None,
) -> "tuple[UserModel, Checked, list[str]]":
    """Return the file's model, what is found of it, and words known before."""
    from robotball.engines.mujoco.user_model import UserModel
    from robotball.errors import mujoco_silent, named
    from robotball.robot.drives import as_drive
    from robotball.scene_files.scene_keys import ask
    from robotball.user_model.robot_file import open_robot, starts_off

    from ..output import progress_bar
    from ..results import controls_of
    from ..studies import check as work

    with mujoco_silent():  # or MuJoCo writes its warnings into the current folder
        robot = open_robot(file, shell)
        seconds = 10.0 if duration is None else duration
        given = controls_of(control)
        controls = {name: as_drive(value, seconds) for name, value in given.items()}
        own, moves = work.moved(UserModel(robot, controls, keyframe))
        start = own.begin()
        with named(file):
            notes = [*robot.notes, *starts_off(robot, start), *moves]
        ask(file, own.scene(rolling or "classical", seconds))
        with progress_bar(1) as show:
            return own, work.check_model(own, rolling, seconds, accuracy, show), notes


def _page_of(study: "Study", checked: "Checked", picture: Path, motions: "Sequence[Motion]") -> str:
    """Return the HTML page of a check, with its picture and a view of the motions."""
    from robotball.motion import versions
    from robotball.view.web import view_fragment, view_head

    from ..report import folded, page, paragraph, plain, table, text
    from ..report import picture as figure
    from ..studies.check import COLUMNS, difference

    lines = study.record["lines"] if study.record else [""]
    cells = [[column.text(row) for column in COLUMNS] for row in study.rows]
    body = [
        f"<h1>{text(study.scene)}</h1>",
        *map(paragraph, lines),
        figure(picture),
        "<h2>3-D view</h2>",
        view_fragment(motions),
        "<h2>What each change is worth</h2>",
        table([column.header for column in COLUMNS], cells, "words"),
        "<h2>The changes</h2>",
        f'<pre class="wide">{escape(chr(10).join(difference(checked)))}</pre>',
        folded("Versions", plain(versions()), short=True),
    ]
    return page(f"robotball: check of {study.scene}", body, view_head())
