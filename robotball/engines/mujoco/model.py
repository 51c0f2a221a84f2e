"""Composition of a scene's MuJoCo model from the parts in mjcf/, with only what the scene needs.

In order: the hinges that a model needs, the model, its composition with its state at the start, and
the depth at which its contact carries the weight. The model is composed as text, which brings every
double back: `MjSpec.attach` composes too, but `MjSpec.to_xml` writes six digits.
"""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np
from scipy.optimize import root_scalar

from robotball.engines.mujoco.settings import Prescribed, Resolved, Settings
from robotball.errors import InputError, mujoco_silent
from robotball.robot.ball import PARTS, Frame, Link, Pendulum, Rotor, Shell
from robotball.robot.drives import turns
from robotball.robot.motors import Actuator, Free, Law, Motor, PositionServo, Servo, Torque
from robotball.robot.scene import MovedHinge, Scene
from robotball.rotations import Array, multiply, rotation_matrix, z_along


@dataclass(frozen=True)
class ModelHinge(MovedHinge):
    """A hinge of the scene as the model has it, with its joint and actuator.

    Sensors and actuators have its name. If it has a motor, that is the scene's own, whose errors
    belong to the motion.

    index       its place among the scene's hinges
    joint       the MJCF name of its joint and of the body that hangs on it
    actuation   a motor, or the armature that lets its rate be prescribed
    rate_scale  the unit of relative errors of its rate [rad/s]
    """

    index: int
    joint: str
    actuation: Motor | Prescribed
    rate_scale: float

    @cached_property
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

    def control(self, t: float) -> float:
        """Return its actuator's control at t [s]: the command, or a prescribed rate's slope."""
        prescribed = isinstance(self.actuation, Prescribed)
        return float((self.command.acceleration if prescribed else self.command.rate)(t))


def hinges_of(scene: Scene, settings: Settings) -> tuple[ModelHinge, ...]:
    """Return the hinges that turn or stand at an angle.

    Any other body is fixed to its parent, which saves MuJoCo a degree of freedom in every step.
    """
    # Of shell and frame, the one without the free joint has the hinge between them.
    joints = {"frame": "shell"} if settings.root == "frame" else {}
    return tuple(
        ModelHinge(
            **vars(each),
            index=index,
            joint=joints.get(each.name, each.name),
            actuation=each.motor or settings.drive,
            rate_scale=scene.rate_scales[index],
        )
        for index, each in enumerate(scene.hinges)
        if each.motor or turns(each.command) or each.angle
    )


_ORIGIN, _Z = np.zeros(3), np.array([0.0, 0.0, 1.0])
_SPHERE = "shell_sphere"  # the geom that touches the plane
START = "start"  # the keyframe that a run begins from

_PARTS = {Shell: "shell", Frame: "frame", Rotor: "rotor", Pendulum: "pendulum", Link: "pendulum"}
_LEAST = 1e-14  # kg and kg m², ten times the least that MuJoCo takes
_SECTIONS = ("option", "worldbody", "contact", "tendon", "actuator", "sensor", "keyframe")
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

    def of(self, scene: Scene) -> "Model":
        """Return the model with another scene, which differs in its commands or its start."""
        model = replace(self, scene=scene, hinges=hinges_of(scene, self.settings))
        # The properties' own places.
        vars(model).update(compiled=self.compiled, sensor_columns=self.sensor_columns)
        return model

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


def build(scene: Scene, settings: Settings) -> Model:
    """Return the model of a scene under settings, at its start; frames and shapes as in Scene.

    Open settings are those of the recipe for the scene's load. Raises InputError where MuJoCo
    refuses the model, or where its contact cannot hold the ball up at the start.
    """
    chosen = Resolved(scene, settings)
    settings, hinges = chosen.settings, hinges_of(scene, chosen.settings)
    root, pair = _compose(chosen, hinges)
    if settings.start_in_equilibrium:
        trial = compiled_model(_text_of(root), settings.softness)
        pair.set("margin", _word(carrying_depth(chosen, mujoco.MjData(trial))))
    model = Model(scene, settings, _text_of(root), hinges)
    assert model.compiled is not None  # an InputError is raised here, if at all
    return model


def _compose(chosen: Resolved, hinges: tuple[ModelHinge, ...]) -> tuple[Element, Element]:
    """Return the MJCF tree and its contact pair."""
    scene, settings, ball = chosen.scene, chosen.settings, chosen.scene.ball
    root = Element("mujoco", model="robotball")
    sections = (SubElement(root, tag) for tag in _SECTIONS)
    option, world, contact, tendons, actuators, sensors, keyframe = sections
    world.extend(_bare("floor"))
    own = {name: value for name, value in vars(settings).items() if hasattr(mujoco.MjOption, name)}
    _set(option, gravity=scene.gravity_at(0.0), **own)
    if settings.adaptive:
        # DOP853 is not MuJoCo's; RK4 comes nearest for whoever steps the MJCF without it.
        _set(option, integrator="RK4")
    flag = _add(option, "flag", warmstart=settings.warmstart, island=settings.island)
    # A diverged state would otherwise be reset to time 0 with one warning, and the run go on.
    _set(flag, autoreset="disable")

    # MuJoCo leaves the J̇v term out of its contact rows. With the shell as root it is zero; with the
    # frame as root a slip of |a (ω×Ω)×γ|/b stays, 5e-4 to 1e-1 of the path.
    above = {link.name: link.parent for link in ball.tree}
    if settings.root == "frame":
        if not ball.has_frame:
            raise InputError('root = "frame" needs a ball with a frame; take root = "shell"')
        above |= {"frame": "", "shell": "frame"}
    given_bodies = dict(ball.named_bodies)
    pivots = {link.name: link.pivot for link in ball.tree}
    bodies: dict[str, Element] = {}
    turning = {}
    for link in sorted(ball.tree, key=lambda each: above[each.name] != ""):  # the root first
        name, given, parent = link.name, given_bodies[link.name], above[link.name]
        body = bodies[name] = _add(bodies.get(parent, world), "body", name=name)
        part = {each.tag: each for each in _bare(_PARTS[type(given)], f"{name}_")}
        body.extend(part.values())
        if name == "shell":
            _set(part["geom"], size=ball.radius)
        if not parent:
            _add(body, "freejoint", name=name)
            body.remove(part["site"])
            _inertial(body, link.mass, link.inertia, link.centre)
            continue
        _set(body, pos=link.pivot - pivots[parent])
        if isinstance(given, Rotor):  # in axes of its own, along which its inertia is diagonal
            quat, axis = z_along(link.axis), _Z
            _set(body, quat=quat)
            across, along = given.transverse_inertia, given.axial_inertia
            _inertial(body, link.mass, np.diag([across, across, along]))
        else:
            # A shell on the frame turns the other way than the frame in the shell.
            axis = -link.axis if name == "shell" else link.axis
            _set(part["site"], quat=z_along(axis))
            # MuJoCo takes no moving body without mass, as is between two joints of one.
            least = _LEAST if link.massless else 0.0
            inertia = link.inertia + least * np.eye(3)
            _inertial(body, link.mass + least, inertia, link.centre - link.pivot)
        turning["frame" if name == "shell" else name] = (body, axis)
    for hinge in hinges:
        _add_hinge(actuators, hinge, *turning[hinge.name])

    joints = {hinge.name: hinge.joint for hinge in hinges}
    for actuator in scene.actuators:
        _add_actuator(tendons, actuators, actuator, joints)

    # An explicit pair alone is tested for contact, and its parameters are not mixed of two geoms'.
    slide, spin, roll = chosen.friction
    friction = [slide, slide, spin, roll, roll][: _FRICTIONS[chosen.condim]]
    pair = _add(contact, "pair", name="contact", geom1="floor", geom2=_SPHERE, friction=friction)
    _set(pair, condim=chosen.condim, solref=settings.solref, solimp=settings.solimp)
    _set(pair, solreffriction=settings.solreffriction)
    _add_sensors(sensors, scene, settings.root, hinges)
    key = _add(keyframe, "key", name=START, ctrl=controls_at(scene, hinges, 0.0) or None)
    qpos, qvel = start_state(scene, settings.root, hinges)
    _set(key, qpos=qpos, qvel=qvel)
    return root, pair


def start_state(scene: Scene, root: str, hinges: tuple[ModelHinge, ...]) -> tuple[Array, Array]:
    """Return qpos and qvel of a start on the constraints, for the body with the free joint."""
    start, shell = scene.start, scene.ball.shell
    turning = [scene.hinges[hinge.index] for hinge in hinges]
    # The free joint's angular velocity is in the root body's axes, its velocity in the world's.
    attitude, root_turning = start.attitude, scene.angular_velocity_at(start)
    frame = scene.hinges[0] if scene.ball.has_frame else None
    shell_turning = root_turning - frame.rate * shell.axis if frame else root_turning
    x, y, _ = shell.radius * (start.to_world @ shell_turning)
    if root == "shell":
        root_turning = shell_turning
        if frame and frame.angle:
            half = -frame.angle / 2
            back = np.array([np.cos(half), *(np.sin(half) * shell.axis)])
            # Seen from the shell, ω - Ω is turned on by the angle.
            attitude = multiply(attitude, back)
            root_turning = rotation_matrix(back).T @ shell_turning
    qpos = [0.0, 0.0, shell.radius, *attitude, *(hinge.angle for hinge in turning)]
    qvel = [y, -x, 0.0, *root_turning, *(hinge.rate for hinge in turning)]
    return np.array(qpos), np.array(qvel)


def _text_of(root: Element) -> str:
    """Return the MJCF text of a composed tree, without empty sections."""
    for empty in [each for each in root if not (len(each) or each.attrib)]:
        root.remove(empty)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _bare(part: str, prefix: str = "") -> Iterator[Element]:
    """Yield the elements of a part without those for pictures, which would slow every step."""
    for each in ElementTree.parse(PARTS / f"{part}.xml").iterfind("worldbody/*"):
        if each.tag != "light" and each.get("class") != "visual":
            each.attrib.pop("material", None)
            _set(each, name=prefix + each.attrib["name"])
            yield each


def _add(parent: Element, tag: str, **values: Any) -> Element:
    """Add and return an MJCF element with those attributes that have a value."""
    element = SubElement(parent, tag)
    _set(element, **values)
    return element


def _set(element: Element, **values: Any) -> None:
    """Set those attributes of an MJCF element that have a value."""
    given = {name: _word(value) for name, value in values.items() if value is not None}
    element.attrib.update(given)


def _word(value: Any) -> str:
    """Return a value as MJCF has it, with the digits that bring every double back."""
    if isinstance(value, str):
        return value
    return " ".join(repr(number).removesuffix(".0") for number in np.ravel(value).tolist())


def _inertial(body: Element, mass: float, inertia: Array, centre: Array = _ORIGIN) -> None:
    """Add a body's mass [kg], inertia (3, 3) [kg m²] about its centre of mass, and that [m]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    _add(body, "inertial", pos=centre, mass=mass, fullinertia=[xx, yy, zz, xy, xz, yz])


def _add_hinge(actuators: Element, hinge: ModelHinge, body: Element, axis: Array) -> None:
    """Add the joint of `body` with its actuator, which every hinge has that is not free."""
    slides, motor = hinge.body.slides, hinge.actuation
    # The armature acts on the hinge alone and adds no angular momentum of its own.
    kind, armature = "slide" if slides else "hinge", motor.armature or None
    joint = _add(body, "joint", name=hinge.joint, type=kind, axis=axis, armature=armature)
    if isinstance(motor, Free):
        rest = motor.rest if slides else np.degrees(motor.rest)
        _set(joint, damping=motor.damping, stiffness=motor.stiffness, springref=rest)
        _set(joint, frictionloss=motor.friction or None)
        return
    on = {"name": hinge.name, "joint": hinge.joint}
    if isinstance(motor, Servo):
        actuator = _add(actuators, "velocity", **on, kv=motor.gain)
    elif isinstance(motor, PositionServo):
        actuator = _add(actuators, "position", **on, kp=motor.gain, kv=motor.damping)
    elif isinstance(motor, Torque | Prescribed):
        # With the gear as scale, the control of a prescribed rate is its acceleration. MuJoCo sets
        # controls over 1e10 to zero, which torques on such an armature would be.
        gear = motor.armature if isinstance(motor, Prescribed) else 1.0
        actuator = _add(actuators, "motor", **on, gear=gear)
    else:
        actuator = _add_law(actuators, motor.law, **on)
        _set(joint, frictionloss=motor.law.friction or None)
    _limit(actuator, hinge.torque_limit)


def _add_law(actuators: Element, law: Law, **on: Any) -> Element:
    """Add and return an actuator that has a motor's law but for its limit."""
    bias = [law.at_rest, -law.per_angle, -law.per_rate]
    gain = law.per_command
    return _add(actuators, "general", biastype="affine", gainprm=gain, biasprm=bias, **on)


def _limit(actuator: Element, limit: float) -> None:
    """Give an actuator the torque limit of its motor [N m], if that has one."""
    if limit < np.inf:
        _set(actuator, forcerange=[-limit, limit])


def controls_at(scene: Scene, hinges: tuple[ModelHinge, ...], t: float) -> list[float]:
    """Return the controls of a model's actuators at t [s]: the hinges' own, then the scene's."""
    own = [hinge.control(t) for hinge in hinges if hinge.actuated]
    return own + [float(command.rate(t)) for command in scene.controls]


def _add_actuator(
    tendons: Element, actuators: Element, actuator: Actuator, joints: Mapping[str, str]
) -> None:
    """Add an actuator of the scene, on a joint or on a tendon that adds several up."""
    (first, *others), name = actuator.gears, actuator.name
    if others:
        tendon = _add(tendons, "fixed", name=name)
        for each, ratio in actuator.gears:
            _add(tendon, "joint", joint=joints[each], coef=ratio)
        on: dict[str, Any] = {"tendon": name}
    else:
        on = {"joint": joints[first[0]], "gear": first[1]}
    _limit(_add_law(actuators, actuator.law, name=name, **on), actuator.law.limit)


def _add_sensors(sensors: Element, scene: Scene, body: str, hinges: tuple[ModelHinge, ...]) -> None:
    """Add the sensors that a Motion needs, of the whole ball at `body`, its root.

    readings.py knows them by name. They are evaluated in compiled code: 250 µs of Python a sample
    would be several steps' time.
    """
    add = partial(_add, sensors)
    add("clock", name="time")
    add("framepos", name="centre", objtype="xbody", objname="shell")
    carrier = "frame" if scene.ball.has_frame else "shell"
    add("framequat", name="attitude", objtype="xbody", objname=carrier)
    add("frameangvel", name="angular_velocity", objtype="xbody", objname=carrier)
    add("subtreelinvel", name="velocity", body=body)
    add("subtreeangmom", name="angular_momentum", body=body)
    if scene.load_varies:  # elsewhere it is the sphere's centre
        add("subtreecom", name="centre_of_mass", body=body)
    data = "found force torque normal tangent linvel angvel"
    add("contact", name="contact", geom1="floor", geom2=_SPHERE, data=data)
    for hinge in hinges:
        add("jointpos", name=f"{hinge.name}_angle", joint=hinge.joint)
        add("jointvel", name=f"{hinge.name}_rate", joint=hinge.joint)
        moved = any(hinge.name == name for each in scene.actuators for name, _ in each.gears)
        if hinge.motor is None:
            kind = "force" if hinge.body.slides else "torque"
            add(kind, name=f"{hinge.name}_torque", site=f"{hinge.joint}_hinge")
        elif hinge.actuated or moved:
            # What the joint carries is less, by what turns the motor's own armature.
            add("jointactuatorfrc", name=f"{hinge.name}_torque", joint=hinge.joint)


def compiled_model(xml: str, softness: float = 1.0) -> Any:
    """Return the MjModel of an MJCF text, with the contact's softness multiplied.

    Raises InputError where MuJoCo refuses it.
    """
    try:
        with mujoco_silent():
            model = mujoco.MjModel.from_xml_string(xml)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"MuJoCo refuses the model: {error}") from None
    # The bodies' inverse weights do nothing but scale the constraints' regulariser, which so gets
    # as small as an impedance nearer to 1 than MuJoCo's .9999 would make it.
    model.body_invweight0[:] *= softness
    return model


def carrying_depth(chosen: Resolved, data: mujoco.MjData) -> float:
    """Return the depth [m] at which the contact carries the weight, for the pair's margin.

    With it the ball starts at rest vertically, its centre at the height of its radius. `data` and
    its model are tried, and changed. Raises InputError where there is no such depth, for the
    contact has no stiffness.
    """
    softness, stiffness = chosen.settings.softness, chosen.normal_reference[0]
    if not 0 < stiffness < np.inf:
        raise InputError(
            f"the contact cannot carry the ball at any depth: solref {chosen.solref} has no "
            "stiffness; give another, or start_in_equilibrium off"
        )
    model = data.model
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
    with mujoco_silent(), warnings.catch_warnings(), suppress(ValueError):  # without a secant
        warnings.simplefilter("ignore")
        found = root_scalar(vertical_acceleration, x0=scale, x1=1.1 * scale, xtol=1e-16)
        if found.converged and 0 < found.root < np.inf:
            return float(found.root)
    # A ball that slips from the start is thrown up at any depth; the normal force alone has one.
    return chosen.equilibrium_depth
