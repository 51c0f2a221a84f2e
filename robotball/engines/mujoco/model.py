"""Composition of a scene's MuJoCo model from the parts in mjcf/, with only what the scene needs.

In order: the hinges that a model needs, the model, its composition by `dm_control.mjcf` with its
state at the start, and the depth at which its contact carries the weight.
"""

import contextlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.optimize import root_scalar

from robotball.ball import PARTS, Frame, Link, Pendulum, Rotor, Shell
from robotball.drives import Drive, turns
from robotball.engines.mujoco.settings import Prescribed, Resolved, Settings
from robotball.errors import InputError
from robotball.motors import Actuator, Free, Law, Motor, PositionServo, Servo, Torque
from robotball.rotations import Array, multiply, rotation_matrix, z_along
from robotball.scene import MovedHinge, Scene

with warnings.catch_warnings(action="ignore"):
    # Without a screen, dm_control's search for a window system warns; nothing here needs one.
    from dm_control import mjcf

_PRECISION = 17  # digits that bring every double back


@dataclass(frozen=True)
class ModelHinge:
    """A hinge of the scene as the model has it, with its joint and actuator.

    index         its place among the scene's hinges
    joint         the MJCF name of its joint and of the body that hangs on it
    of            the scene's hinge
    actuation     a motor, or the armature that lets its rate be prescribed
    largest_rate  of the drive during the scene, by which errors are measured [rad/s]
    """

    index: int
    joint: str
    of: MovedHinge
    actuation: Motor | Prescribed
    largest_rate: float

    @property
    def body(self) -> str:
        """The MJCF name of the body that hangs on it, by which sensors are named."""
        return self.of.name

    @property
    def drive(self) -> Drive:
        """The scene's command: a rate, an angle or a torque."""
        return self.of.command

    @property
    def own_motor(self) -> bool:
        """True if the motor is the scene's own, so that its errors belong to the motion."""
        return self.of.motor is not None

    @property
    def actuated(self) -> bool:
        """True if it has an actuator; a free hinge has none."""
        return not isinstance(self.actuation, Free)

    @property
    def law(self) -> Law | None:
        """The law of its motor; None where its rate is prescribed."""
        return None if isinstance(self.actuation, Prescribed) else self.actuation.law

    @property
    def torque_limit(self) -> float:
        """The torque limit of its motor [N m]; infinite without either."""
        return self.law.limit if self.law else np.inf

    @property
    def settles(self) -> bool:
        """True if its torque depends on its angle or rate, as it does of all motors but Torque."""
        return not isinstance(self.actuation, Torque | Prescribed)

    @property
    def follows_rate(self) -> bool:
        """True if its command is a rate."""
        return isinstance(self.actuation, Servo | Prescribed)

    def control(self, t: float) -> float:
        """Return its actuator's control at t [s]: the command, or a prescribed rate's slope."""
        prescribed = isinstance(self.actuation, Prescribed)
        return float((self.drive.acceleration if prescribed else self.drive.rate)(t))


def hinges_of(scene: Scene, settings: Settings) -> tuple[ModelHinge, ...]:
    """Return the hinges that turn or stand at an angle.

    Any other body is fixed to its parent, which saves MuJoCo a degree of freedom in every step.
    """
    # Of shell and frame, the one without the free joint has the hinge between them.
    joints = {"frame": "shell"} if settings.root == "frame" else {}
    return tuple(
        ModelHinge(
            index,
            joints.get(each.name, each.name),
            each,
            actuation=each.motor or settings.drive,
            largest_rate=scene.largest_rates[index] or 1.0,
        )
        for index, each in enumerate(scene.hinges)
        if each.motor or turns(each.command) or each.angle
    )


_ORIGIN, _Z = np.zeros(3), np.array([0.0, 0.0, 1.0])
_SPHERE = "shell_sphere"  # the geom that touches the plane
START = "start"  # the keyframe that a run begins from

_PARTS = {Shell: "shell", Frame: "frame", Rotor: "rotor", Pendulum: "pendulum", Link: "pendulum"}
_LEAST = 1e-14  # kg and kg m², ten times the least that MuJoCo takes
_PICTURE_ONLY = ("light", "material", "texture", "mesh")
_FRICTIONS = {3: 2, 4: 3, 6: 5}  # how many coefficients a contact of each condim has


@dataclass(frozen=True)
class Model:
    """A composed model, whose MJCF text is complete and compiles to the same bits anywhere.

    settings: with nothing left open, so that a report has the values that ran.
    """

    scene: Scene
    settings: Settings
    xml: str
    hinges: tuple[ModelHinge, ...]

    @cached_property
    def compiled(self) -> mujoco.MjModel:
        """The MjModel. A run may set its timestep, for no other Model has it.

        Raises InputError where MuJoCo refuses it.
        """
        return compiled_model(self.xml, self.settings.softness)

    @cached_property
    def sensor_columns(self) -> dict[str, slice]:
        """The columns of sensordata by the sensor's name."""
        sensors = [self.compiled.sensor(i) for i in range(self.compiled.nsensor)]
        return {each.name: slice(each.adr[0], each.adr[0] + each.dim[0]) for each in sensors}

    @property
    def has_torque_limits(self) -> bool:
        """True if a motor of the model has a torque limit."""
        limits = [each.torque_limit for each in self.hinges]
        limits += [each.law.limit for each in self.scene.actuators]
        return any(limit < np.inf for limit in limits)

    def start_data(self, scene: Scene | None = None) -> mujoco.MjData:
        """Return MjData at the model's start, or at that of another scene of the same ball."""
        data = mujoco.MjData(self.compiled)
        mujoco.mj_resetDataKeyframe(self.compiled, data, 0)
        if scene is not None:
            data.qpos, data.qvel = start_state(scene, self.settings.root, self.hinges)
        return data


def build(chosen: Resolved) -> Model:
    """Return the model of a scene under settings, at its start; frames and shapes as in Scene.

    Raises InputError where MuJoCo refuses the model, or where its contact cannot hold the ball up
    at the start.
    """
    scene, settings = chosen.scene, chosen.settings
    hinges = hinges_of(scene, settings)
    root, pair = _compose(chosen, hinges)
    if settings.start_in_equilibrium:
        trial = compiled_model(_text_of(root), settings.softness)
        pair.margin = carrying_depth(chosen, trial)
    model = Model(scene, settings, _text_of(root), hinges)
    assert model.compiled is not None  # an InputError is raised here, if at all
    return model


def _compose(chosen: Resolved, hinges: tuple[ModelHinge, ...]) -> tuple[Any, Any]:
    """Return the MJCF tree and its contact pair."""
    scene, settings, ball = chosen.scene, chosen.settings, chosen.scene.ball
    root, values = _bare("floor"), vars(settings)
    # DOP853 is not MuJoCo's; RK4 comes nearest for whoever steps the MJCF without it.
    _fill(root.option, values | ({"integrator": "RK4"} if settings.adaptive else {}))
    _fill(root.option.flag, values)
    root.option.gravity = scene.gravity_world
    # A diverged state would otherwise be reset to time 0 with one warning, and the run go on.
    root.option.flag.autoreset = "disable"

    # MuJoCo leaves the J̇v term out of its contact rows. With the shell as root it is zero; with the
    # frame as root a slip of |a (ω×Ω)×γ|/b stays, 5e-4 to 1e-1 of the path.
    above = {link.name: link.parent for link in ball.tree}
    if settings.root == "frame":
        if not ball.has_frame:
            raise InputError('root = "frame" needs a ball with a frame; take root = "shell"')
        above |= {"frame": "", "shell": "frame"}
    bodies = dict(ball.named_bodies)
    pivots = {link.name: link.pivot for link in ball.tree}
    parts: dict[str, Any] = {}
    turning = {}
    for link in sorted(ball.tree, key=lambda each: above[each.name] != ""):  # the root first
        name, given, parent = link.name, bodies[link.name], above[link.name]
        part = parts[name] = _bare(_PARTS[type(given)])
        part.model = name
        if name == "shell":
            part.find("geom", "sphere").size = [ball.radius]
        if not parent:
            body = root.attach(part)
            body.add("freejoint")
            part.find("site", "hinge").remove()
            _inertial(body, link.mass, link.inertia, link.centre)
            continue
        body = parts[parent].attach(part)
        body.pos = link.pivot - pivots[parent]
        if isinstance(given, Rotor):  # in axes of its own, along which its inertia is diagonal
            body.quat, axis = z_along(link.axis), _Z
            across, along = given.transverse_inertia, given.axial_inertia
            _inertial(body, link.mass, np.diag([across, across, along]))
        else:
            # A shell on the frame turns the other way than the frame in the shell.
            axis = -link.axis if name == "shell" else link.axis
            part.find("site", "hinge").quat = z_along(axis)
            # MuJoCo takes no moving body without mass, as is between two joints of one.
            least = _LEAST if link.massless else 0.0
            inertia = link.inertia + least * np.eye(3)
            _inertial(body, link.mass + least, inertia, link.centre - link.pivot)
        turning["frame" if name == "shell" else name] = (body, axis)
    for hinge in hinges:
        _add_hinge(root, hinge, *turning[hinge.of.name])

    for actuator in scene.actuators:
        _add_actuator(root, actuator, {hinge.body: hinge.joint for hinge in hinges})

    # An explicit pair alone is tested for contact, and its parameters are not mixed of two geoms'.
    slide, spin, roll = chosen.friction
    friction = [slide, slide, spin, roll, roll][: _FRICTIONS[chosen.condim]]
    own = {"name": "contact", "condim": chosen.condim, "friction": friction}
    pair = root.contact.add("pair", geom1="floor", geom2=_SPHERE)
    _fill(pair, values | own)
    _add_sensors(root, scene, settings.root, hinges)
    qpos, qvel = start_state(scene, settings.root, hinges)
    ctrl = np.array(controls_at(scene, hinges, 0.0))
    actuated = {"ctrl": ctrl} if len(ctrl) else {}  # no empty attribute
    root.keyframe.add("key", name=START, qpos=qpos, qvel=qvel, **actuated)
    return root, pair


def start_state(scene: Scene, root: str, hinges: tuple[ModelHinge, ...]) -> tuple[Array, Array]:
    """Return qpos and qvel of a start on the constraints, for the body with the free joint."""
    start, shell = scene.start, scene.ball.shell
    turning = [scene.hinges[hinge.index] for hinge in hinges]
    # The free joint's angular velocity is in the root body's axes, its velocity in the world's.
    attitude, root_turning = start.attitude, scene.angular_velocity_at(start)
    frame = scene.hinges[0] if scene.ball.has_frame else None
    shell_turning = root_turning - frame.rate * shell.axis if frame else root_turning
    velocity = np.cross(rotation_matrix(start.attitude) @ shell_turning, [0.0, 0.0, shell.radius])
    if root == "shell":
        root_turning = shell_turning
        if frame and frame.angle:
            back = _turn(shell.axis, -frame.angle)
            # Seen from the shell, ω - Ω is turned on by the angle.
            attitude = multiply(attitude, back)
            root_turning = rotation_matrix(back).T @ shell_turning
    qpos = [0.0, 0.0, shell.radius, *attitude, *(hinge.angle for hinge in turning)]
    qvel = [*velocity, *root_turning, *(hinge.rate for hinge in turning)]
    return np.array(qpos), np.array(qvel)


def _turn(axis: Array, angle: float) -> Array:
    """Return the quaternion (4,) of a turn about a unit axis (3,) by an angle [rad]."""
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def _text_of(root: Any) -> str:
    """Return the MJCF text of a composed tree of parts, without classes and with one-word names.

    dm_control scopes names by `/`, as in shell/frame/rotor1/hinge, and itself reads no file that
    has them. Parts have different names, so the last of them and the element's own say enough:
    rotor1, rotor1_hinge.
    """
    tree = ElementTree.fromstring(root.to_xml_string(precision=_PRECISION))
    for element in tree.iter():
        element.attrib.pop("class", None)
        for attribute, value in element.items():
            if "/" in value:
                element.set(attribute, "_".join(filter(None, value.split("/")[-2:])))
    for empty in tree.findall("default"):
        tree.remove(empty)
    ElementTree.indent(tree)
    return ElementTree.tostring(tree, encoding="unicode") + "\n"


def _bare(name: str) -> Any:
    """Return a part without its visual elements (lights, materials, meshes).

    They would slow every step.
    """
    tree = mjcf.from_path(str(PARTS / f"{name}.xml"))
    for kind in _PICTURE_ONLY:
        for element in tree.find_all(kind, exclude_attachments=True):
            element.remove()
    for geom in tree.find_all("geom"):
        if geom.dclass is not None and geom.dclass.dclass == "visual":
            geom.remove()
    for element in (tree.visual, tree.statistic, *tree.default.default):
        element.remove()
    return tree


def _fill(element: Any, values: Mapping[str, Any]) -> None:
    """Set those attributes of an MJCF element that have a value under their name."""
    for name in element.spec.attributes:
        if values.get(name) is not None:
            setattr(element, name, values[name])


def _inertial(body: Any, mass: float, inertia: Array, centre: Array = _ORIGIN) -> None:
    """Add a body's mass [kg], inertia (3, 3) [kg m²] about its centre of mass, and that [m]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    body.add("inertial", pos=centre, mass=mass, fullinertia=[xx, yy, zz, xy, xz, yz])


def _add_hinge(root: Any, hinge: ModelHinge, body: Any, axis: Array) -> None:
    """Add the joint of `body` with its actuator, which every hinge has that is not free."""
    kind = "slide" if hinge.of.body.slides else "hinge"
    joint, motor = body.add("joint", type=kind, axis=axis), hinge.actuation
    if motor.armature:
        # It acts on the hinge alone and adds no angular momentum of its own.
        joint.armature = motor.armature
    if isinstance(motor, Free):
        joint.damping, joint.stiffness = motor.damping, motor.stiffness
        joint.frictionloss = motor.friction or None
        joint.springref = motor.rest if hinge.of.body.slides else np.degrees(motor.rest)
        return
    add, names = root.actuator.add, {"name": hinge.body, "joint": joint}
    if isinstance(motor, Servo):
        actuator = add("velocity", **names, kv=motor.gain)
    elif isinstance(motor, PositionServo):
        actuator = add("position", **names, kp=motor.gain, kv=motor.damping)
    elif isinstance(motor, Torque | Prescribed):
        # With the gear as scale, the control of a prescribed rate is its acceleration. MuJoCo sets
        # controls over 1e10 to zero, which torques on such an armature would be.
        gear = motor.armature if isinstance(motor, Prescribed) else 1.0
        actuator = add("motor", **names, gear=[gear])
    else:
        actuator = _add_law(root, motor.law, **names)
    if hinge.torque_limit < np.inf:
        actuator.forcerange = [-hinge.torque_limit, hinge.torque_limit]


def _add_law(root: Any, law: Law, **on: Any) -> Any:
    """Add and return an actuator that has a motor's law but for its limit."""
    return root.actuator.add(
        "general",
        biastype="affine",
        gainprm=[law.per_command],
        biasprm=[law.at_rest, -law.per_angle, -law.per_rate],
        **on,
    )


def controls_at(scene: Scene, hinges: tuple[ModelHinge, ...], t: float) -> list[float]:
    """Return the controls of a model's actuators at t [s]: the hinges' own, then the scene's."""
    own = [hinge.control(t) for hinge in hinges if hinge.actuated]
    return own + [float(command.rate(t)) for command in scene.controls]


def _add_actuator(root: Any, actuator: Actuator, joints: Mapping[str, str]) -> None:
    """Add an actuator of the scene, on a joint or on a tendon that adds several up."""
    law, (first, *others) = actuator.law, actuator.gears
    if others:
        tendon = root.tendon.add("fixed", name=actuator.name)
        for name, ratio in actuator.gears:
            tendon.add("joint", joint=joints[name], coef=ratio)
        on = {"tendon": tendon}
    else:
        on = {"joint": joints[first[0]], "gear": [first[1]]}
    added = _add_law(root, law, name=actuator.name, **on)
    if law.limit < np.inf:
        added.forcerange = [-law.limit, law.limit]


def _add_sensors(root: Any, scene: Scene, body: str, hinges: tuple[ModelHinge, ...]) -> None:
    """Add the sensors that a Motion needs, of the whole ball at `body`, its root.

    readings.py knows them by name. They are evaluated in compiled code: 250 µs of Python a sample
    would be several steps' time.
    """
    add = root.sensor.add
    add("clock", name="time")
    add("framepos", name="centre", objtype="xbody", objname="shell")
    carrier = "frame" if scene.ball.has_frame else "shell"
    add("framequat", name="attitude", objtype="xbody", objname=carrier)
    add("frameangvel", name="angular_velocity", objtype="xbody", objname=carrier)
    add("subtreelinvel", name="velocity", body=body)
    add("subtreeangmom", name="angular_momentum", body=body)
    if scene.load_varies:  # elsewhere it is the sphere's centre
        add("subtreecom", name="centre_of_mass", body=body)
    add(
        "contact",
        name="contact",
        geom1="floor",
        geom2=_SPHERE,
        data="found force torque normal tangent linvel angvel",
    )
    for hinge in hinges:
        add("jointpos", name=f"{hinge.body}_angle", joint=hinge.joint)
        add("jointvel", name=f"{hinge.body}_rate", joint=hinge.joint)
        moved = any(hinge.body == name for each in scene.actuators for name, _ in each.gears)
        if not hinge.own_motor:
            kind = "force" if hinge.of.body.slides else "torque"
            add(kind, name=f"{hinge.body}_torque", site=f"{hinge.joint}_hinge")
        elif hinge.actuated or moved:
            # What the joint carries is less, by what turns the motor's own armature.
            add("jointactuatorfrc", name=f"{hinge.body}_torque", joint=hinge.joint)


def compiled_model(xml: str, softness: float = 1.0) -> Any:
    """Return the MjModel of an MJCF text, with the contact's softness multiplied.

    Raises InputError where MuJoCo refuses it.
    """
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"MuJoCo refuses the model: {error}") from None
    # The bodies' inverse weights do nothing but scale the constraints' regulariser, which so gets
    # as small as an impedance nearer to 1 than MuJoCo's .9999 would make it.
    model.body_invweight0[:] *= softness
    return model


def carrying_depth(chosen: Resolved, model: mujoco.MjModel) -> float:
    """Return the depth [m] at which the contact carries the weight, for the pair's margin.

    With it the ball starts at rest vertically, its centre at the height of its radius. `model` is
    tried, and changed. Raises InputError where there is no such depth, for the contact has no
    stiffness.
    """
    softness, stiffness = chosen.settings.softness, chosen.normal_reference[0]
    if not 0 < stiffness < np.inf:
        raise InputError(
            f"the contact cannot carry the ball at any depth: solref {chosen.solref} has no "
            "stiffness; give another, or start_in_equilibrium off"
        )
    data = mujoco.MjData(model)
    if softness < 1:
        # So hard a contact hardly slips without the noslip solver. That takes the acceleration from
        # the forces, whose rounding is magnified until no depth is found.
        model.opt.noslip_iterations = 0

    def vertical_acceleration(margin: float) -> float:
        mujoco.mj_resetDataKeyframe(model, data, 0)
        model.pair_margin[0] = margin
        mujoco.mj_forward(model, data)
        return float(data.qacc[2])

    # The acceleration is nearly linear in the depth, g about k times it: a secant needs few steps.
    scale = softness * chosen.scene.gravity / stiffness
    with warnings.catch_warnings(), contextlib.suppress(ValueError):  # no secant to follow
        warnings.simplefilter("ignore")
        found = root_scalar(vertical_acceleration, x0=scale, x1=1.1 * scale, xtol=1e-16)
        if found.converged and 0 < found.root < np.inf:
            return float(found.root)
    # A ball that slips from the start is thrown up at any depth; the normal force alone has one.
    return chosen.equilibrium_depth
