"""Compose a scene's MuJoCo model from those parts in mjcf/ that the scene needs.

The model is composed as text, which preserves every double. `MjSpec.attach` can compose models too,
but `MjSpec.to_xml` writes only six digits.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np

from robotball.engines.mujoco.settings import Prescribed, Resolved, Settings
from robotball.engines.observe import depth_at_rest
from robotball.errors import InputError, mujoco_silent
from robotball.robot.ball import PARTS, Frame, Link, Pendulum, Rotor, Shell
from robotball.robot.drives import Drive, turns
from robotball.robot.motors import Actuator, Free, Law, Motor, PositionServo, Servo, Torque
from robotball.robot.scene import MovedHinge, Scene
from robotball.rotations import Array, multiply, rotation_matrix, z_along


@dataclass(frozen=True)
class ModelHinge(MovedHinge):
    """A hinge of the model, with its joint and actuator.

    Sensors and actuators have the hinge's name. A motor belongs to the scene, so its tracking
    errors are part of the motion.

    Attributes
    ----------
    index : int
        The index of the hinge among the scene's hinges.
    joint : str
        The MJCF name of its joint and of the joint's body.
    actuation : Motor or Prescribed
        The scene's motor, or the armature of a prescribed rate.
    rate_scale : float, rad/s
        The unit of relative errors of its rate.
    """

    index: int
    joint: str
    actuation: Motor | Prescribed
    rate_scale: float

    @cached_property
    def actuated(self) -> bool:
        """True if the hinge has an actuator, that is, if it is not free."""
        return not isinstance(self.actuation, Free)

    @property
    def law(self) -> Law | None:
        """The law of its motor; None if its rate is prescribed."""
        return None if isinstance(self.actuation, Prescribed) else self.actuation.law

    @property
    def torque_limit(self) -> float:
        """The torque limit of its motor [N m]; infinite without a limit."""
        return self.law.limit if self.law else np.inf

    @property
    def settles(self) -> bool:
        """True if the torque depends on the angle or the rate, as in all motors except Torque."""
        return not isinstance(self.actuation, Torque | Prescribed)

    def control(self, t: float) -> float:
        """Return the actuator's control at t [s]: the command, or a prescribed acceleration."""
        prescribed = isinstance(self.actuation, Prescribed)
        return float((self.command.acceleration if prescribed else self.command.rate)(t))


def hinges_of(scene: Scene, settings: Settings) -> tuple[ModelHinge, ...]:
    """Return the hinges that turn or have an angle.

    Other bodies are fixed to their parents, which saves MuJoCo a degree of freedom in every step.
    """
    # The hinge between shell and frame belongs to the body without the free joint.
    joints = {"frame": "shell"} if settings.root == "frame" else {}
    return tuple(
        ModelHinge(
            **vars(hinge),
            index=index,
            joint=joints.get(hinge.name, hinge.name),
            actuation=hinge.motor or settings.drive,
            rate_scale=scene.rate_scales[index],
        )
        for index, hinge in enumerate(scene.hinges)
        if hinge.motor or turns(hinge.command) or hinge.angle
    )


@dataclass(frozen=True)
class GearedMotor:
    """A motor of a hinge, or an actuator, with gear ratios (h,) to the model's hinges."""

    name: str
    law: Law
    command: Drive
    gears: Array


def motors_of(scene: Scene, hinges: tuple[ModelHinge, ...]) -> list[GearedMotor]:
    """Return the motors of a model's hinges, then the actuators of its scene."""
    places = dict(zip([hinge.name for hinge in hinges], np.eye(len(hinges)), strict=True))
    motors = [GearedMotor(h.name, h.law, h.command, places[h.name]) for h in hinges if h.law]
    for actuator, command in zip(scene.actuators, scene.controls, strict=True):
        gears = np.sum([ratio * places[name] for name, ratio in actuator.gears], axis=0)
        motors.append(GearedMotor(actuator.name, actuator.law, command, gears))
    return motors


@dataclass(frozen=True)
class DryFriction:
    """Dry friction of m motors on h hinges; gears (m, h)."""

    laws: tuple[Law, ...]
    gears: Array

    def torques(self, rates: Array) -> Array:
        """Return the torques (h,) on the hinges at their rates (h,) [rad/s]."""
        moved = zip(self.laws, self.gears @ rates, strict=True)
        return np.array([law.dry_friction(rate) for law, rate in moved]) @ self.gears


def friction_of(resolved: Resolved, hinges: tuple[ModelHinge, ...]) -> DryFriction | None:
    """Return the dry friction that a run applies as torques; None if there is none.

    Steps of first order keep MuJoCo's row, because such steps would not be accurate even in short
    parts.
    """
    dry = [motor for motor in motors_of(resolved.scene, hinges) if motor.law.friction]
    if not dry or resolved.integrator.order == 1:
        return None
    return DryFriction(tuple(m.law for m in dry), np.stack([motor.gears for motor in dry]))


_ORIGIN, _Z = np.zeros(3), np.array([0.0, 0.0, 1.0])
_SPHERE = "shell_sphere"  # the geom that touches the plane
START = "start"  # the keyframe that a run begins from

_PARTS = {Shell: "shell", Frame: "frame", Rotor: "rotor", Pendulum: "pendulum", Link: "pendulum"}
# The flag that removes MuJoCo's rows of dry friction.
NO_ROWS = int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
ROW_DAMPING = 1.8  # damping of a row of dry friction, times the timestep; MuJoCo divides it by 0.95
_LEAST = 1e-14  # kg and kg m², ten times MuJoCo's least mass and inertia
_SECTIONS = ("option", "worldbody", "contact", "tendon", "actuator", "sensor", "keyframe")
_FRICTIONS = {3: 2, 4: 3, 6: 5}  # the number of friction coefficients by condim


@dataclass(frozen=True)
class Model:
    """A composed model, whose complete MJCF text compiles to the same bits anywhere.

    The settings have the recipe's values, so that a report shows the values of the run.
    """

    scene: Scene
    settings: Settings
    xml: str
    hinges: tuple[ModelHinge, ...]
    # The model of another scene with the same text, which is compiled for the two scenes.
    original: "Model | None" = field(default=None, compare=False, repr=False)

    @cached_property
    def compiled(self) -> mujoco.MjModel:
        """The MjModel. It belongs only to this Model, so a run may set its timestep.

        Raises InputError if MuJoCo refuses it.
        """
        if self.original is not None:
            return self.original.compiled
        return _compiled_model(self.xml, self.settings.softness)

    def of(self, scene: Scene) -> "Model":
        """Return the model with a scene that differs only in its commands or its start."""
        hinges = hinges_of(scene, self.settings)
        return replace(self, scene=scene, hinges=hinges, original=self.original or self)

    @cached_property
    def sensor_columns(self) -> dict[str, slice]:
        """The columns of sensordata by the sensor's name."""
        if self.original is not None:
            return self.original.sensor_columns
        sensors = [self.compiled.sensor(i) for i in range(self.compiled.nsensor)]
        return {s.name: slice(s.adr[0], s.adr[0] + s.dim[0]) for s in sensors}

    @property
    def has_torque_limits(self) -> bool:
        """True if a motor of the model has a torque limit."""
        return any(m.law.limit < np.inf for m in motors_of(self.scene, self.hinges))

    @cached_property
    def dry_friction(self) -> DryFriction | None:
        """The dry friction that a run applies as torques."""
        return friction_of(Resolved(self.scene, self.settings), self.hinges)

    def start_data(self, scene: Scene | None = None) -> mujoco.MjData:
        """Return MjData at the model's start, or at the start of a scene with the same ball."""
        data = mujoco.MjData(self.compiled)
        mujoco.mj_resetDataKeyframe(self.compiled, data, 0)
        if scene is not None:
            data.qpos, data.qvel = start_state(scene, self.settings.root, self.hinges)
        return data


def build(scene: Scene, settings: Settings, sensed: bool = True) -> Model:
    """Build the model of a scene under settings, with the recipe's values for the scene's load.

    sensed: add the sensors that `readings` needs; other engines may not support these sensors.
    Raises InputError if MuJoCo refuses the model, or if its contact cannot carry the ball at the
    start.
    """
    resolved = Resolved(scene, settings)
    settings, hinges = resolved.settings, hinges_of(scene, resolved.settings)
    root, pair = _compose(resolved, hinges, sensed)
    if settings.start_in_equilibrium:
        trial = _compiled_model(_text_of(root), settings.softness)
        pair.set("margin", _word(carrying_depth(resolved, mujoco.MjData(trial))))
    model = Model(scene, settings, _text_of(root), hinges)
    _ = model.compiled  # raises InputError here
    return model


def _compose(
    resolved: Resolved, hinges: tuple[ModelHinge, ...], sensed: bool
) -> tuple[Element, Element]:
    """Return the MJCF tree and its contact pair."""
    scene, settings, ball = resolved.scene, resolved.settings, resolved.scene.ball
    root = Element("mujoco", model="robotball")
    sections = (SubElement(root, tag) for tag in _SECTIONS)
    option, world, contact, tendons, actuators, sensors, keyframe = sections
    (floor,) = _bare("floor")
    world.append(floor)
    if scene.plane_turns:
        _set(floor, surfacevel=[0.0] * 5 + [float(scene.plane_turn.rate(0.0))])
    fields = vars(settings).items()
    options = {name: value for name, value in fields if hasattr(mujoco.MjOption, name)}
    if not settings.own:
        # RK4 is MuJoCo's best integrator for other programs that run the MJCF. With the timestep of
        # order 8, MuJoCo's flag refsafe would soften the contact.
        options |= {"integrator": "RK4", "timestep": None}
    _set(option, gravity=scene.gravity_at(0.0), **options)
    flag = _add(option, "flag", warmstart=settings.warmstart, island=settings.island)
    # Otherwise MuJoCo resets a diverged state to time 0 with one warning and continues the run.
    _set(flag, autoreset="disable")

    # MuJoCo leaves the J̇v term out of its contact rows. With the shell as root this term is zero;
    # with the frame as root the ball slips by |a (ω×Ω)×γ|/b, which is 5e-4 to 1e-1 of the path.
    above = {link.name: link.parent for link in ball.tree}
    if settings.root == "frame":
        if not ball.has_frame:
            raise InputError('root = "frame" needs a ball with a frame: take root = "shell"')
        above |= {"frame": "", "shell": "frame"}
    parts = dict(ball.named_bodies)
    pivots = {link.name: link.pivot for link in ball.tree}
    bodies: dict[str, Element] = {}
    turning = {}
    for link in sorted(ball.tree, key=lambda link: above[link.name] != ""):  # the root first
        name, part, parent = link.name, parts[link.name], above[link.name]
        body = bodies[name] = _add(bodies.get(parent, world), "body", name=name)
        elements = {element.tag: element for element in _bare(_PARTS[type(part)], f"{name}_")}
        body.extend(elements.values())
        if name == "shell":
            _set(elements["geom"], size=ball.radius)
        if not parent:
            _add(body, "freejoint", name=name)
            body.remove(elements["site"])
            _inertial(body, link.mass, link.inertia, link.centre)
            continue
        _set(body, pos=link.pivot - pivots[parent])
        if isinstance(part, Rotor):  # its body has principal axes
            quat, axis = z_along(link.axis), _Z
            _set(body, quat=quat)
            across, along = part.transverse_inertia, part.axial_inertia
            _inertial(body, link.mass, np.diag([across, across, along]))
        else:
            # A shell that hangs on the frame turns opposite to the frame in the shell.
            axis = -link.axis if name == "shell" else link.axis
            _set(elements["site"], quat=z_along(axis))
            # MuJoCo refuses a moving body without mass, such as the one between two joints.
            least = _LEAST if link.massless else 0.0
            inertia = link.inertia + least * np.eye(3)
            _inertial(body, link.mass + least, inertia, link.centre - link.pivot)
        turning["frame" if name == "shell" else name] = (body, axis)
    for hinge in hinges:
        _add_hinge(actuators, hinge, *turning[hinge.name])
    if settings.solreffriction:  # if None, as in "naive", joints keep MuJoCo's default too
        for joint in world.iterfind(".//joint[@frictionloss]"):
            _set(joint, solreffriction=friction_reference(resolved.option("timestep")))

    joints = {hinge.name: hinge.joint for hinge in hinges}
    for actuator in scene.actuators:
        _add_actuator(tendons, actuators, actuator, joints)

    # The parameters of an explicit pair are not mixed from two geoms, and no other pair is tested.
    slide, spin, roll = resolved.friction
    friction = [slide, slide, spin, roll, roll][: _FRICTIONS[resolved.condim]]
    pair = _add(contact, "pair", name="contact", geom1="floor", geom2=_SPHERE, friction=friction)
    _set(pair, condim=resolved.condim, solref=settings.solref, solimp=settings.solimp)
    _set(pair, solreffriction=settings.solreffriction)
    if sensed:
        _add_sensors(sensors, scene, settings.root, hinges)
    key = _add(keyframe, "key", name=START, ctrl=controls_at(scene, hinges, 0.0) or None)
    qpos, qvel = start_state(scene, settings.root, hinges)
    _set(key, qpos=qpos, qvel=qvel)
    return root, pair


def start_state(scene: Scene, root: str, hinges: tuple[ModelHinge, ...]) -> tuple[Array, Array]:
    """Return qpos and qvel of the start, which rolls or has the scene's slip."""
    start, shell = scene.start, scene.ball.shell
    turning = [scene.hinges[hinge.index] for hinge in hinges]
    # The free joint has its angular velocity in body axes, and its velocity in world axes.
    attitude, (slip_x, slip_y, spin) = start.attitude, scene.start_slip.tolist()
    root_turning = scene.angular_velocity_at(start) + spin * start.to_world[2]
    frame = scene.hinges[0] if scene.ball.has_frame else None
    shell_turning = root_turning - frame.rate * shell.axis if frame else root_turning
    x, y, _ = shell.radius * (start.to_world @ shell_turning)
    if root == "shell":
        root_turning = shell_turning
        if frame and frame.angle:
            half = -frame.angle / 2
            back = np.array([np.cos(half), *(np.sin(half) * shell.axis)])
            # ω - Ω in the axes of the shell.
            attitude = multiply(attitude, back)
            root_turning = rotation_matrix(back).T @ shell_turning
    qpos = [0.0, 0.0, shell.radius, *attitude, *(hinge.angle for hinge in turning)]
    qvel = [y + slip_x, slip_y - x, 0.0, *root_turning, *(hinge.rate for hinge in turning)]
    return np.array(qpos), np.array(qvel)


def _text_of(root: Element) -> str:
    """Return the MJCF text of a composed tree, without empty sections."""
    for empty in [section for section in root if not (len(section) or section.attrib)]:
        root.remove(empty)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _bare(part: str, prefix: str = "") -> Iterator[Element]:
    """Yield the elements of a part, without visual elements, which would slow every step."""
    for element in ElementTree.parse(PARTS / f"{part}.xml").iterfind("worldbody/*"):
        if element.tag != "light" and element.get("class") != "visual":
            element.attrib.pop("material", None)
            _set(element, name=prefix + element.attrib["name"])
            yield element


def _add(parent: Element, tag: str, **values: Any) -> Element:
    """Add and return an MJCF element, with the attributes that are not None."""
    element = SubElement(parent, tag)
    _set(element, **values)
    return element


def _set(element: Element, **values: Any) -> None:
    """Set the attributes of an MJCF element that are not None."""
    element.attrib.update({name: _word(v) for name, v in values.items() if v is not None})


def _word(value: Any) -> str:
    """Return a value in MJCF, with enough digits to preserve every double."""
    if isinstance(value, str):
        return value
    return " ".join(repr(number).removesuffix(".0") for number in np.ravel(value).tolist())


def _inertial(body: Element, mass: float, inertia: Array, centre: Array = _ORIGIN) -> None:
    """Add a body's mass [kg], centre of mass [m] and inertia (3, 3) about it [kg m²]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    _add(body, "inertial", pos=centre, mass=mass, fullinertia=[xx, yy, zz, xy, xz, yz])


def friction_reference(timestep: float) -> tuple[float, float]:
    """Return the solreffriction of a row of dry friction; the error scales with 1/damping.

    The damping is the largest at which all integrators are stable.
    """
    return 0.0, -ROW_DAMPING / timestep


def _add_hinge(actuators: Element, hinge: ModelHinge, body: Element, axis: Array) -> None:
    """Add the joint of `body`, with an actuator unless the hinge is free."""
    slides, motor = hinge.body.slides, hinge.actuation
    # The armature acts on the hinge alone and adds no angular momentum.
    kind, armature = "slide" if slides else "hinge", motor.armature or None
    joint = _add(body, "joint", name=hinge.joint, type=kind, axis=axis, armature=armature)
    _set(joint, frictionloss=(hinge.law and hinge.law.friction) or None)
    if isinstance(motor, Free):
        rest = motor.rest if slides else np.degrees(motor.rest)
        _set(joint, damping=motor.damping, stiffness=motor.stiffness, springref=rest)
        return
    on = {"name": hinge.name, "joint": hinge.joint}
    if isinstance(motor, Servo):
        actuator = _add(actuators, "velocity", **on, kv=motor.gain)
    elif isinstance(motor, PositionServo):
        actuator = _add(actuators, "position", **on, kp=motor.gain, kv=motor.damping)
    elif isinstance(motor, Torque | Prescribed):
        # The gear makes the control of a prescribed rate an acceleration. MuJoCo sets controls over
        # 1e10 to zero, and the torques on such an armature are larger.
        gear = motor.armature if isinstance(motor, Prescribed) else 1.0
        actuator = _add(actuators, "motor", **on, gear=gear)
    else:
        actuator = _add_law(actuators, motor.law, **on)
    _limit(actuator, hinge.torque_limit)


def _add_law(actuators: Element, law: Law, **on: Any) -> Element:
    """Add and return an actuator with a motor's law, without its limit."""
    bias = [law.at_rest, -law.per_angle, -law.per_rate]
    gain = law.per_command
    return _add(actuators, "general", biastype="affine", gainprm=gain, biasprm=bias, **on)


def _limit(actuator: Element, limit: float) -> None:
    """Give an actuator the torque limit of its motor [N m], if there is one."""
    if limit < np.inf:
        _set(actuator, forcerange=[-limit, limit])


def controls_at(scene: Scene, hinges: tuple[ModelHinge, ...], t: float) -> list[float]:
    """Return the controls of a model's actuators at t [s], first of hinges, then of the scene."""
    controls = [hinge.control(t) for hinge in hinges if hinge.actuated]
    return controls + [float(command.rate(t)) for command in scene.controls]


def _add_actuator(
    tendons: Element, actuators: Element, actuator: Actuator, joints: Mapping[str, str]
) -> None:
    """Add an actuator of the scene, on a joint or on a tendon that couples several joints."""
    (first, *others), name, law = actuator.gears, actuator.name, actuator.law
    if law.friction and law.limit < np.inf:
        raise InputError(f"{name}: MuJoCo supports dry friction or a torque limit, not both")
    if others or law.friction:
        tendon = _add(tendons, "fixed", name=name, frictionloss=law.friction or None)
        for hinge, ratio in actuator.gears:
            _add(tendon, "joint", joint=joints[hinge], coef=ratio)
        on: dict[str, Any] = {"tendon": name}
    else:
        on = {"joint": joints[first[0]], "gear": first[1]}
    _limit(_add_law(actuators, law, name=name, **on), law.limit)


def _add_sensors(sensors: Element, scene: Scene, body: str, hinges: tuple[ModelHinge, ...]) -> None:
    """Add the sensors for a Motion; to compute them in Python would take 250 µs per sample."""
    add = partial(_add, sensors)
    add("clock", name="time")
    add("framepos", name="centre", objtype="xbody", objname="shell")
    carrier = "frame" if scene.ball.has_frame else "shell"
    add("framequat", name="attitude", objtype="xbody", objname=carrier)
    add("frameangvel", name="angular_velocity", objtype="xbody", objname=carrier)
    add("subtreelinvel", name="velocity", body=body)
    add("subtreeangmom", name="angular_momentum", body=body)
    if scene.load_varies:  # otherwise it is the centre of the sphere
        add("subtreecom", name="centre_of_mass", body=body)
    data = "found force torque normal tangent linvel angvel"
    add("contact", name="contact", geom1="floor", geom2=_SPHERE, data=data)
    for hinge in hinges:
        add("jointpos", name=f"{hinge.name}_angle", joint=hinge.joint)
        add("jointvel", name=f"{hinge.name}_rate", joint=hinge.joint)
        moved = any(hinge.name in dict(actuator.gears) for actuator in scene.actuators)
        if hinge.motor is None:
            kind = "force" if hinge.body.slides else "torque"
            add(kind, name=f"{hinge.name}_torque", site=f"{hinge.joint}_hinge")
        elif hinge.actuated or moved:
            # The load of the joint lacks the torque that accelerates the motor's armature.
            add("jointactuatorfrc", name=f"{hinge.name}_torque", joint=hinge.joint)


def _compiled_model(xml: str, softness: float = 1.0) -> Any:
    """Return an MJCF text's MjModel with softened contact. Raises InputError if refused."""
    try:
        with mujoco_silent():
            model = mujoco.MjModel.from_xml_string(xml)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"MuJoCo refuses the model: {error}") from None
    # The inverse weights of bodies only scale the regulariser of the constraints. With smaller
    # weights the regulariser becomes smaller than MuJoCo's largest impedance of .9999 allows.
    model.body_invweight0[:] *= softness
    return model


def carrying_depth(resolved: Resolved, data: mujoco.MjData) -> float:
    """Return the depth [m] at which the contact carries the weight: the pair's margin.

    With this margin the ball starts without vertical acceleration, and its centre is at the height
    of its radius. `data` and its model are changed. Raises InputError if the contact has no
    stiffness.
    """
    softness, stiffness = resolved.settings.softness, resolved.normal_reference[0]
    if not 0 < stiffness < np.inf:
        raise InputError(
            f"the contact cannot carry the ball at any depth: solref {resolved.solref} has no "
            "stiffness: give another solref, or start_in_equilibrium=False"
        )
    model = data.model
    if softness < 1:
        # So hard a contact hardly slips without the noslip solver, which computes the acceleration
        # from the forces and magnifies the rounding of the forces, so that no depth would be found.
        model.opt.noslip_iterations = 0

    friction = friction_of(resolved, hinges_of(resolved.scene, resolved.settings))
    if friction is not None:
        model.opt.disableflags |= NO_ROWS

    def vertical_acceleration(margin: float) -> float:
        mujoco.mj_resetDataKeyframe(model, data, 0)
        if friction is not None:
            data.qfrc_applied[6:] = friction.torques(data.qvel[6:])
        model.pair_margin[0] = margin
        mujoco.mj_forward(model, data)
        return float(data.qacc[2])

    scale = softness * resolved.scene.gravity / stiffness
    with mujoco_silent():
        depth = depth_at_rest(vertical_acceleration, scale, 1.1 * scale, 1e-16)
    if 0 < depth < np.inf:
        return depth
    # A ball that slips at the start has an upward acceleration at any depth. Without friction there
    # is an equilibrium.
    return resolved.equilibrium_depth
