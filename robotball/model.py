"""Scene + Settings → MJCF, composed from the parts in mjcf/; only what the scene needs."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.optimize import root_scalar

from robotball.bodies import Rotor
from robotball.rotations import Array, from_matrix, perpendicular, rotation_matrix
from robotball.scene import Scene
from robotball.settings import Prescribed, Servo, Settings
from robotball.start import Start

with warnings.catch_warnings():
    # Without a screen, dm_control's search for a window system warns; nothing here needs one.
    warnings.simplefilter("ignore")
    from dm_control import mjcf

PARTS = Path(__file__).parent.parent / "mjcf"
PRECISION = 17  # digits that bring every double back
SHELL, FRAME = "shell/", "shell/frame/"
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
class Hinge:
    """A hinge: its place among the scene's rates, its body, its joint, its rate [rad/s]."""

    index: int
    body: str
    joint: str
    rate: float


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

    def start_data(self, start: Start | None = None) -> mujoco.MjData:
        """MjData at the scene's start, or at another one of the same ball."""
        data = mujoco.MjData(self.compiled)
        mujoco.mj_resetDataKeyframe(self.compiled, data, 0)
        if start is not None:
            data.qpos, data.qvel = _state_at(self.scene, start, self.hinges)
        return data


def build(scene: Scene, settings: Settings) -> Model:
    """The model of `scene` under `settings`, at its start; frames and shapes as in Scene."""
    root, pair, hinges = _compose(scene, settings)
    if settings.start_in_equilibrium:
        pair.margin = _equilibrium_depth(root.to_xml_string(precision=PRECISION))
    return Model(scene, settings, root.to_xml_string(precision=PRECISION), hinges)


def _compose(scene: Scene, settings: Settings) -> tuple[Any, Any, tuple[Hinge, ...]]:
    """The MJCF tree, its contact pair, and its hinges."""
    ball = scene.ball
    root = _bare("floor")
    root.option.gravity = [0, 0, -scene.gravity]
    for name in OPTIONS:
        _set(root.option, name, getattr(settings, name))
    _set(root.option.flag, "warmstart", settings.warmstart)
    # A diverged run must end as one, not begin again from time 0.
    root.option.flag.autoreset = "disable"

    # The shell is the root: contact rows have no J̇v term, and only on it is that term zero.
    shell_part = _bare("shell")
    shell_part.find("geom", "sphere").size = [ball.radius]
    shell = root.attach(shell_part)
    shell.add("freejoint")
    _inertial(shell, ball.shell.mass, ball.shell.inertia)

    frame_part = _bare("frame")
    frame = shell_part.attach(frame_part)
    _inertial(frame, ball.frame.mass, ball.frame.inertia)
    hinges = _hinge(root, 0, frame, ball.shell.axis, scene.frame_rate, settings)

    for i, (rotor, rate) in enumerate(zip(ball.rotors, scene.rotor_rates, strict=True), start=1):
        rotor_part = _bare("rotor")
        rotor_part.model = f"rotor{i}"
        rotor_body = frame_part.attach(rotor_part)
        rotor_body.quat = z_along(rotor.axis)
        _rotor_inertial(rotor_body, rotor)
        hinges += _hinge(root, i, rotor_body, np.array([0.0, 0.0, 1.0]), rate, settings)

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
    _sensors(root, hinges)
    root.keyframe.add("key", name=START, **_start_state(scene, hinges, settings))
    return root, pair, hinges


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


def _inertial(body: Any, mass: float, inertia: Array) -> None:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    body.add("inertial", pos=[0, 0, 0], mass=mass, fullinertia=[xx, yy, zz, xy, xz, yz])


def _rotor_inertial(body: Any, rotor: Rotor) -> None:
    across, along = rotor.transverse_inertia, rotor.axial_inertia
    body.add("inertial", pos=[0, 0, 0], mass=rotor.mass, diaginertia=[across, across, along])


def z_along(axis: Array) -> Array:
    """A quaternion that turns z onto `axis`."""
    side = perpendicular(axis)
    return from_matrix(np.stack([side, np.cross(axis, side), axis], axis=1))


def _friction(scene: Scene, settings: Settings) -> list[float]:
    slide = [settings.sliding_friction] * 2
    return [*slide, settings.torsional_friction] if scene.rolling == "rubber" else slide


def _hinge(
    root: Any, index: int, body: Any, axis: Array, rate: float, settings: Settings
) -> tuple[Hinge, ...]:
    """The hinge and drive of `body`; none where it does not turn."""
    if rate == 0:
        return ()
    name = "frame" if index == 0 else f"rotor{index}"
    joint = body.add("joint", type="hinge", axis=axis)
    if isinstance(settings.drive, Prescribed):
        # It acts on the hinge alone and adds no angular momentum of its own.
        joint.armature = settings.drive.armature
    else:
        root.actuator.add("velocity", name=name, joint=joint, kv=settings.drive.gain)
    return (Hinge(index, name, joint.full_identifier, rate),)


def _sensors(root: Any, hinges: tuple[Hinge, ...]) -> None:
    """What a Motion needs, and nothing else; simulate.py reads them in this order."""
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


def _start_state(scene: Scene, hinges: tuple[Hinge, ...], settings: Settings) -> dict[str, Array]:
    """The start's qpos and qvel, and servos' ctrl."""
    qpos, qvel = _state_at(scene, scene.start, hinges)
    state = {"qpos": qpos, "qvel": qvel}
    return {**state, "ctrl": qvel[6:]} if isinstance(settings.drive, Servo) else state


def _state_at(scene: Scene, start: Start, hinges: tuple[Hinge, ...]) -> tuple[Array, Array]:
    """qpos and qvel of a start on the constraints, hinges at angle zero and at their rates."""
    shell = scene.ball.shell
    # At the start frame and shell axes coincide; the free joint's angular velocity is local.
    shell_turning = scene.angular_velocity_at(start) - scene.frame_rate * shell.axis
    to_world = rotation_matrix(start.attitude)
    velocity = np.cross(to_world @ shell_turning, [0.0, 0.0, shell.radius])
    rates = np.array([hinge.rate for hinge in hinges])
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
