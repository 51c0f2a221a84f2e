"""Check a robot file in one call, for the command `check` and for tests in Python."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from robotball.engines.mujoco.user_model import UserModel
from robotball.errors import check_positive, mujoco_silent, named
from robotball.robot.drives import Rate, as_drive
from robotball.robot.formulas import Rolling
from robotball.scene_files.scene_keys import ask
from robotball.user_model.robot_file import open_robot, starts_off

from ..options import CHECK_TIME, CHECKED
from ..output import progress_bar
from .ablate import Checked, check_model
from .observe import made_to_move
from .say import lines_of

_FIRST_LINE = 0.2  # s of a check, after which it says how long it takes


@dataclass(frozen=True)
class RobotCheck:
    """Hold the outcome of `check_robot`.

    Attributes
    ----------
    agrees : bool
        Whether the robot of the file moves and rolls as it should.
    message : str
        The verdict, the cause of an error and other symptoms, one a line.

    Examples
    --------
    >>> from validation import RobotCheck
    >>> RobotCheck(agrees=True, message="unmodified: agrees").agrees
    True
    """

    agrees: bool
    message: str


def check_robot(
    file: str | Path,
    duration: float = CHECK_TIME,
    *,
    controls: Mapping[str, Rate] | None = None,
    accuracy: float = CHECKED,
) -> RobotCheck:
    """Say whether an MJCF or URDF robot rolls as it should with the settings of its file.

    These are its contact, timestep, integrator and solver. `compare` and `assert_agrees` replace
    them by their own. `robotball check` also writes a mended file.

    Parameters
    ----------
    file : str or Path
        The MJCF or URDF file of the robot.
    duration : float, s, default 10
        The simulated time.
    controls : mapping of str to float or drive, optional
        The controls, by the names of actuators. The default is those of the first keyframe.
    accuracy : float, default 1e-3
        The largest path error that counts as agreement.

    Returns
    -------
    RobotCheck
        The verdict, and its words.

    Raises
    ------
    InputError
        If the file cannot be used, or the duration or the accuracy is not positive.

    Examples
    --------
    >>> from pathlib import Path
    >>> import robotball as rb
    >>> damped = '<joint type="free" damping="1"/>'
    >>> ball = f'<body pos="0 0 .1">{damped}<geom size=".1"/></body>'
    >>> floor = '<geom type="plane" size="9 9 1"/>'
    >>> text = f"<mujoco><worldbody>{floor}{ball}</worldbody></mujoco>"
    >>> length = Path("ball.xml").write_text(text)
    >>> rb.check_robot("ball.xml", 1.0).agrees
    False
    """
    checked, notes = checked_robot(Path(file), controls or {}, duration, accuracy)
    return RobotCheck(checked.agrees, "\n".join(lines_of(checked, notes)))


def checked_robot(
    file: Path,
    controls: Mapping[str, Rate],
    duration: float = CHECK_TIME,
    accuracy: float = CHECKED,
    shell: str | None = None,
    rolling: Rolling | None = None,
    keyframe: str | None = None,
) -> tuple[Checked, list[str]]:
    """Return the outcome of the check, and the lines to print before it."""
    check_positive("accuracy", accuracy, "")
    check_positive("duration", duration, "s")
    with mujoco_silent():  # or MuJoCo writes its warnings into the current folder
        robot = open_robot(file, shell)
        drives = {name: as_drive(value, duration) for name, value in controls.items()}
        user, moves = made_to_move(UserModel(robot, drives, keyframe))
        ask(file, user.scene(rolling or "classical", duration))
        with progress_bar(1, first_line=_FIRST_LINE) as show:
            checked = check_model(user, rolling, duration, accuracy, show)
        kept = checked.observation.theory.scene.start.slip
        with named(file):
            return checked, [*robot.notes, *starts_off(robot, user.begin(), kept), *moves]
