"""Scene + Settings → MJCF, composed from the parts in mjcf/; only what the scene needs."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.optimize import root_scalar

from robotball.contact.hinges import FRAME, SHELL, Hinge, hinges_of
from robotball.drives import Servo
from robotball.rotations import Array, from_matrix, perpendicular, rotation_matrix
from robotball.scene import Scene
from robotball.settings import Settings
from robotball.start import Start

with warnings.catch_warnings():
    # Without a screen, dm_control's search for a window system warns; nothing here needs one.
    warnings.simplefilter("ignore")
    from dm_control import mjcf

PARTS = Path(__file__).parents[2] / "mjcf"
PRECISION = 17  # digits that bring every double back
ORIGIN, Z = np.zeros(3), np.array([0.0, 0.0, 1.0])
START = "start"  # the keyframe that a run begins from

OPTIONS = (
    "timestep",
    "integrator",
    "solver",
    "jacobian",
    "iterations",
    "tolerance",
    "ls_tolerance",
    "noslip_iterations",
    "noslip_tolerance",
    "cone",
    "impratio",
)
PICTURE_ONLY = ("light", "material", "texture", "mesh")
PAIR_OPTIONS = ("solref", "solimp", "solreffriction")


@dataclass(frozen=True)
class Model:
    """A composed model: its MJCF text is complete, and compiles to the same bits anywhere."""

    scene: Scene
    settings: Settings
    xml: str
    hinges: tuple[Hinge, ...]

    @cached_property
    def compiled(self) -> mujoco.MjModel:
        """A fresh MjModel; one a Model, so that a run may set its timestep."""
        return mujoco.MjModel.from_xml_string(self.xml)

    @property
    def actuated(self) -> tuple[Hinge, ...]:
        """The hinges with an actuator, in the order of MuJoCo's ctrl."""
        return tuple(hinge for hinge in self.hinges if hinge.actuated)

    def start_data(self, start: Start | None = None) -> mujoco.MjData:
        """MjData at the scene's start, or at another one of the same ball."""
        data = mujoco.MjData(self.compiled)
        mujoco.mj_resetDataKeyframe(self.compiled, data, 0)
        if start is not None:
            data.qpos, data.qvel = _state_at(self.scene, start, self.hinges)
        return data


def build(scene: Scene, settings: Settings) -> Model:
    """The model of `scene` under `settings`, at its start; frames and shapes as in Scene."""
    hinges = hinges_of(scene, settings)
    root, pair = _compose(scene, settings, hinges)
    if settings.start_in_equilibrium:
        pair.margin = _equilibrium_depth(root.to_xml_string(precision=PRECISION))
    return Model(scene, settings, root.to_xml_string(precision=PRECISION), hinges)


def _compose(scene: Scene, settings: Settings, hinges: tuple[Hinge, ...]) -> tuple[Any, Any]:
    """The MJCF tree and its contact pair."""
    ball = scene.ball
    root = _bare("floor")
    root.option.gravity = [0, 0, -scene.gravity]
    for name in OPTIONS:
        _set(root.option, name, getattr(settings, name))
    _set(root.option.flag, "warmstart", settings.warmstart)
    # A diverged run must end as one, not begin again from time 0.
    root.option.flag.autoreset = "disable"

    # The shell is the root: contact rows have no J̇v term, and only on it is that term zero.
    shell_part, frame_part = _bare("shell"), _bare("frame")
    shell_part.find("geom", "sphere").size = [ball.radius]
    shell = root.attach(shell_part)
    shell.add("freejoint")
    _inertial(shell, ball.shell.mass, ball.shell.inertia)
    frame = shell_part.attach(frame_part)
    _inertial(frame, ball.frame.mass, ball.frame.inertia, ball.frame.centre)
    frame_part.find("site", "hinge").quat = z_along(ball.shell.axis)
    turning = [(frame, ball.shell.axis)]
    for i, rotor in enumerate(ball.rotors, start=1):
        rotor_part = _bare("rotor")
        rotor_part.model = f"rotor{i}"
        body = frame_part.attach(rotor_part)
        body.pos, body.quat = rotor.centre, z_along(rotor.axis)
        across, along = rotor.transverse_inertia, rotor.axial_inertia
        _inertial(body, rotor.mass, np.diag([across, across, along]))
        turning.append((body, Z))
    for hinge in hinges:
        _add_hinge(root, hinge, *turning[hinge.index])

    pair = root.contact.add(
        "pair",
        name="contact",
        geom1="floor",
        geom2="shell/sphere",
        condim=4 if scene.rolling == "rubber" else 3,
        friction=_friction(scene, settings),
    )
    for name in PAIR_OPTIONS:
        _set(pair, name, getattr(settings, name))
    _add_sensors(root, hinges)
    root.keyframe.add("key", name=START, **_start_state(scene, hinges))
    return root, pair


def part(name: str) -> Any:
    """The hand-written part mjcf/`name`.xml as it is, in units of the ball's radius."""
    return mjcf.from_path(str(PARTS / f"{name}.xml"))


def _bare(name: str) -> Any:
    """A part without what only a picture of it needs; MuJoCo would carry it through every step."""
    tree = part(name)
    for kind in PICTURE_ONLY:
        for element in tree.find_all(kind, exclude_attachments=True):
            element.remove()
    for geom in tree.find_all("geom"):
        if geom.dclass is not None and geom.dclass.dclass == "visual":
            geom.remove()
    for element in (tree.visual, tree.statistic, *tree.default.default):
        element.remove()
    return tree


def _set(element: Any, attribute: str, value: Any) -> None:
    if value is not None:
        setattr(element, attribute, value)


def _inertial(body: Any, mass: float, inertia: Array, centre: Array = ORIGIN) -> None:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    body.add("inertial", pos=centre, mass=mass, fullinertia=[xx, yy, zz, xy, xz, yz])


def z_along(axis: Array) -> Array:
    """A quaternion that turns z onto `axis`."""
    side = perpendicular(axis)
    return from_matrix(np.stack([side, np.cross(axis, side), axis], axis=1))


def _friction(scene: Scene, settings: Settings) -> list[float]:
    slide = [settings.sliding_friction] * 2
    return [*slide, settings.torsional_friction] if scene.rolling == "rubber" else slide


def _add_hinge(root: Any, hinge: Hinge, body: Any, axis: Array) -> None:
    """The joint of `body`, and its actuator where it needs one."""
    joint = body.add("joint", type="hinge", axis=axis)
    if isinstance(hinge.by, Servo):
        servo = root.actuator.add("velocity", name=hinge.body, joint=joint, kv=hinge.by.gain)
        if hinge.by.torque_limit is not None:
            servo.forcerange = [-hinge.by.torque_limit, hinge.by.torque_limit]
        return
    # It acts on the hinge alone and adds no angular momentum of its own.
    joint.armature = hinge.by.armature
    if hinge.actuated:
        # Scaled by the gear, the control is the acceleration; MuJoCo refuses controls over 1e10.
        root.actuator.add("motor", name=hinge.body, joint=joint, gear=[hinge.by.armature])


def _add_sensors(root: Any, hinges: tuple[Hinge, ...]) -> None:
    """What a Motion needs, and nothing else; readings.py knows them by name."""
    add = root.sensor.add
    add("clock", name="time")
    add("framepos", name="centre", objtype="xbody", objname=SHELL)
    add("framequat", name="attitude", objtype="xbody", objname=FRAME)
    add("frameangvel", name="angular_velocity", objtype="xbody", objname=FRAME)
    add("subtreelinvel", name="velocity", body=SHELL)
    add("subtreeangmom", name="angular_momentum", body=SHELL)
    add(
        "contact",
        name="contact",
        geom1="floor",
        geom2="shell/sphere",
        data="found force torque normal tangent linvel angvel",
    )
    for hinge in hinges:
        add("jointpos", name=f"{hinge.body}_angle", joint=hinge.joint)
        add("jointvel", name=f"{hinge.body}_rate", joint=hinge.joint)
        add("torque", name=f"{hinge.body}_torque", site=f"{hinge.joint}hinge")


def _start_state(scene: Scene, hinges: tuple[Hinge, ...]) -> dict[str, Array]:
    """The start's qpos, qvel and ctrl."""
    qpos, qvel = _state_at(scene, scene.start, hinges)
    ctrl = np.array([hinge.control(0.0) for hinge in hinges if hinge.actuated])
    return {"qpos": qpos, "qvel": qvel, **({"ctrl": ctrl} if len(ctrl) else {})}


def _state_at(scene: Scene, start: Start, hinges: tuple[Hinge, ...]) -> tuple[Array, Array]:
    """qpos and qvel of a start on the constraints, hinges at angle zero and at their rates."""
    shell = scene.ball.shell
    # At the start frame and shell axes coincide; the free joint's angular velocity is local.
    frame_rate = float(scene.drives[0].rate(0.0))
    shell_turning = scene.angular_velocity_at(start) - frame_rate * shell.axis
    velocity = np.cross(rotation_matrix(start.attitude) @ shell_turning, [0.0, 0.0, shell.radius])
    rates = np.array([float(hinge.drive.rate(0.0)) for hinge in hinges])
    qpos = np.concatenate([[0.0, 0.0, shell.radius], start.attitude, np.zeros(len(hinges))])
    return qpos, np.concatenate([velocity, shell_turning, rates])


def _equilibrium_depth(xml: str) -> float:
    """The depth [m] at which the contact carries the weight: as the pair's margin it lets the
    ball start at rest vertically with its centre at the height of its radius.
    """
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)

    def vertical_acceleration(margin: float) -> float:
        mujoco.mj_resetDataKeyframe(model, data, 0)
        model.pair_margin[0] = margin
        mujoco.mj_forward(model, data)
        return float(data.qacc[2])

    scale = -float(model.opt.gravity[2]) * model.pair_solref[0, 0] ** 2
    return float(root_scalar(vertical_acceleration, x0=scale, x1=1.1 * scale, xtol=1e-16).root)
