"""Scene + Settings → MJCF, composed from the parts in mjcf/; only what the scene needs."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from robotball.engines.mujoco.chosen import Chosen
from robotball.engines.mujoco.dress import dress
from robotball.engines.mujoco.equilibrium import carrying_depth, compiled_model
from robotball.engines.mujoco.hinges import Hinge, hinges_of
from robotball.engines.mujoco.settings import Prescribed, Settings
from robotball.engines.mujoco.start_state import start_state, state_at
from robotball.files.mjcf import part, text_of
from robotball.motors import Free, PositionServo, Servo
from robotball.rotations import Array, z_along
from robotball.scene import Scene
from robotball.start import Start

ORIGIN, Z = np.zeros(3), np.array([0.0, 0.0, 1.0])
SPHERE = "shell_sphere"  # the geom that touches the plane
START = "start"  # the keyframe that a run begins from

OPTIONS = (
    "timestep",
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
FLAGS = ("warmstart", "island")
PICTURE_ONLY = ("light", "material", "texture", "mesh")
PAIR_OPTIONS = ("solref", "solimp", "solreffriction")
FRICTIONS = {3: 2, 4: 3, 6: 5}  # how many coefficients a contact of each condim has


@dataclass(frozen=True)
class Model:
    """A composed model: its MJCF text is complete, and compiles to the same bits anywhere."""

    scene: Scene
    settings: Settings
    xml: str
    hinges: tuple[Hinge, ...]

    @cached_property
    def compiled(self) -> mujoco.MjModel:
        """A fresh MjModel; one a Model, so that a run may set its timestep.

        Raises InputError where MuJoCo refuses it.
        """
        return compiled_model(self.xml, self.settings.softness)

    @cached_property
    def sensor_columns(self) -> dict[str, slice]:
        """Where the readings of each sensor are in sensordata."""
        sensors = [self.compiled.sensor(i) for i in range(self.compiled.nsensor)]
        return {each.name: slice(each.adr[0], each.adr[0] + each.dim[0]) for each in sensors}

    def start_data(self, start: Start | None = None) -> mujoco.MjData:
        """MjData at the scene's start, or at another one of the same ball."""
        data = mujoco.MjData(self.compiled)
        mujoco.mj_resetDataKeyframe(self.compiled, data, 0)
        if start is not None:
            data.qpos, data.qvel = state_at(self.scene, self.settings, start, self.hinges)
        return data


def build(scene: Scene, settings: Settings, *, dressed: bool = False) -> Model:
    """The model of `scene` under `settings`, at its start; frames and shapes as in Scene.

    dressed: with what only a picture needs: shapes, materials, lights, a camera.
    Raises InputError where MuJoCo refuses it, or cannot hold the ball up at the start.
    """
    settings = Chosen(scene, settings).settings
    hinges = hinges_of(scene, settings)
    root, pair = _compose(scene, settings, hinges)
    if settings.start_in_equilibrium:
        pair.margin = carrying_depth(scene, settings, text_of(root))
    xml = text_of(root)
    model = Model(scene, settings, dress(xml, scene.ball) if dressed else xml, hinges)
    assert model.compiled is not None  # refused here, if at all
    return model


def _compose(scene: Scene, settings: Settings, hinges: tuple[Hinge, ...]) -> tuple[Any, Any]:
    """The MJCF tree and its contact pair."""
    ball = scene.ball
    root = _bare("floor")
    root.option.gravity = scene.gravity_world
    for name in OPTIONS:
        _set(root.option, name, getattr(settings, name))
    # DOP853 is not MuJoCo's; RK4 is what comes nearest for whoever steps the MJCF without it.
    _set(root.option, "integrator", "RK4" if settings.adaptive else settings.integrator)
    for name in FLAGS:
        _set(root.option.flag, name, getattr(settings, name))
    # A diverged run must end as one, not begin again from time 0.
    root.option.flag.autoreset = "disable"

    # With the shell as root the contact rows' J̇v term, which MuJoCo leaves out, is zero.
    parts = {"shell": _bare("shell"), "frame": _bare("frame")}
    shell_part, frame_part = parts["shell"], parts["frame"]
    root_part = parts.pop(settings.root)
    (child_part,) = parts.values()
    shell_part.find("geom", "sphere").size = [ball.radius]
    body = {root_part: root.attach(root_part)}
    body[root_part].add("freejoint")
    body[child_part] = root_part.attach(child_part)
    _inertial(body[shell_part], ball.shell.mass, ball.shell.inertia, ball.shell.centre)
    _inertial(body[frame_part], ball.frame.mass, ball.frame.inertia, ball.frame.centre)
    # The frame turns about this axis in the shell; a shell on a hinge of the frame the other way.
    axis = ball.shell.axis if child_part is frame_part else -ball.shell.axis
    root_part.find("site", "hinge").remove()
    child_part.find("site", "hinge").quat = z_along(axis)
    turning = [(body[child_part], axis)]
    for i, rotor in enumerate(ball.rotors, start=1):
        rotor_part = _bare("rotor")
        rotor_part.model = f"rotor{i}"
        spinning = frame_part.attach(rotor_part)
        spinning.pos, spinning.quat = rotor.centre, z_along(rotor.axis)
        across, along = rotor.transverse_inertia, rotor.axial_inertia
        _inertial(spinning, rotor.mass, np.diag([across, across, along]))
        turning.append((spinning, Z))
    for name, pendulum in ball.named_pendulums:
        pendulum_part = _bare("pendulum")
        pendulum_part.model = name
        pendulum_part.find("site", "hinge").quat = z_along(pendulum.axis)
        swinging = frame_part.attach(pendulum_part)
        swinging.pos = pendulum.pivot
        _inertial(swinging, pendulum.mass, pendulum.inertia, pendulum.centre - pendulum.pivot)
        turning.append((swinging, pendulum.axis))
    for hinge in hinges:
        _add_hinge(root, hinge, *turning[hinge.index])

    chosen = Chosen(scene, settings)
    slide, spin, roll = chosen.friction
    pair = root.contact.add(
        "pair",
        name="contact",
        geom1="floor",
        geom2=SPHERE,
        condim=chosen.condim,
        friction=[slide, slide, spin, roll, roll][: FRICTIONS[chosen.condim]],
    )
    for name in PAIR_OPTIONS:
        _set(pair, name, getattr(settings, name))
    _add_sensors(root, scene, settings, hinges)
    root.keyframe.add("key", name=START, **start_state(scene, settings, hinges))
    return root, pair


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


def _add_hinge(root: Any, hinge: Hinge, body: Any, axis: Array) -> None:
    """The joint of `body` and its actuator: every hinge that turns has one, unless it is free."""
    joint, motor = body.add("joint", type="hinge", axis=axis), hinge.actuation
    if motor.armature:
        # It acts on the hinge alone and adds no angular momentum of its own.
        joint.armature = motor.armature
    if isinstance(motor, Free):
        joint.damping, joint.stiffness = motor.damping, motor.stiffness
        joint.springref = np.degrees(motor.rest)
        return
    add, names = root.actuator.add, {"name": hinge.body, "joint": joint}
    if isinstance(motor, Servo):
        actuator = add("velocity", **names, kv=motor.gain)
    elif isinstance(motor, PositionServo):
        actuator = add("position", **names, kp=motor.gain, kv=motor.damping)
    else:
        # Scaled by the gear, the control of a prescribed rate is the acceleration; MuJoCo refuses
        # controls over 1e10.
        gear = motor.armature if isinstance(motor, Prescribed) else 1.0
        actuator = add("motor", **names, gear=[gear])
    if hinge.torque_limit is not None:
        actuator.forcerange = [-hinge.torque_limit, hinge.torque_limit]


def _add_sensors(root: Any, scene: Scene, settings: Settings, hinges: tuple[Hinge, ...]) -> None:
    """What a Motion needs, and nothing else; readings.py knows them by name."""
    add = root.sensor.add
    add("clock", name="time")
    add("framepos", name="centre", objtype="xbody", objname="shell")
    add("framequat", name="attitude", objtype="xbody", objname="frame")
    add("frameangvel", name="angular_velocity", objtype="xbody", objname="frame")
    add("subtreelinvel", name="velocity", body=settings.root)
    add("subtreeangmom", name="angular_momentum", body=settings.root)
    if scene.load_varies:  # elsewhere it is the sphere's centre
        add("subtreecom", name="centre_of_mass", body=settings.root)
    add(
        "contact",
        name="contact",
        geom1="floor",
        geom2=SPHERE,
        data="found force torque normal tangent linvel angvel",
    )
    for hinge in hinges:
        add("jointpos", name=f"{hinge.body}_angle", joint=hinge.joint)
        add("jointvel", name=f"{hinge.body}_rate", joint=hinge.joint)
        if not hinge.own_motor:
            add("torque", name=f"{hinge.body}_torque", site=f"{hinge.joint}_hinge")
        elif hinge.actuated:
            # What the joint carries is less, by what turns the motor's own armature.
            add("jointactuatorfrc", name=f"{hinge.body}_torque", joint=hinge.joint)
