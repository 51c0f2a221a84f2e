"""Run a user's model as its file says, beside the equations, and name the first bad state.

The model is stepped with plain `mj_step`. The reference is the motion of the same bodies with the
same motors, springs and friction, for the rolling model that is nearer. It rolls as long as the
file's friction allows, and slips otherwise.
"""

import contextlib
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, get_args

import mujoco
import numpy as np

from robotball import InputError, Scene, integrate
from robotball.engines.mujoco.user_model import ALOFT_HEIGHT, Symptoms, UserModel, observed, turned
from robotball.errors import SceneWarning, named
from robotball.motion import ContactMotion, ReferenceMotion
from robotball.robot.ball import imbalance
from robotball.robot.drives import Constant, Drive, as_drive
from robotball.robot.formulas import Rolling
from robotball.robot.scene import DOWN, GRAVITY
from robotball.rotations import Array, rotation_matrix
from robotball.theory.dop853 import LEAST_RTOL
from robotball.user_model.robot_file import RobotFile, body_name, gears_of, rolling_of

from ..output import Show

_GRAVITY = 0.02  # relative difference from the Earth: a smaller one is usual
_TURNS = 5.0  # of a hinge's range: fewer are usual
_ROLLING_FRICTION = 0.1  # of the radius: less is usual
_SMALL_GEAR = 0.01  # larger ones are usual
_INTERVAL = 0.01  # s between compared samples; at least one step
_READ_INTERVAL = 1e-3  # s between states whose contacts are read; at least one step
_SHORTEST_STEP = 1e-7  # s: with a shorter timestep a check takes many minutes
_LEAST_PATH = 0.1  # of the radius: no verdict on a shorter motion
_SUNK = 0.1  # of the radius: a soft contact holds the sphere higher
_STUCK = 0.05  # of the distance that the reference reaches
_SHOCK_STEPS = 3
_SMALL_INERTIA = 1e-2  # of a solid ball: larger ones are usual
_DENSEST = 22_600.0  # kg/m³, osmium
_FAR = 2.0  # radii from the sphere's middle: bodies are usually nearer
_ROUNDING = 1e-6  # relative, of moments in a file
_PATIENCE = 10.0  # s of processor time for the reference
_REFERENCE_ERROR = 1e-6  # of the accuracy: then its path errs by up to 1e-5 of the accuracy in 10 s
_NEARER = 0.5  # a rolling model other than the contact's must halve the error
# Controls and push for a robot that nothing moves.
_AT_REST = 1e-3  # of the radius: a robot with a shorter path is at rest
_ANGLE, _RATE = 0.3, 2.0  # rad and rad/s, commands of servos
_TORQUE = 0.03  # of the robot's weight times the radius, of motors


@dataclass(frozen=True)
class Observation:
    """A model as its file says, beside its reference.

    Attributes
    ----------
    user : UserModel
    accuracy : float
        The path error that was asked for.
    interval, duration : float, s
        The time between compared samples, and the time that was asked for, in whole samples.
    contact : MjContact
        The contact of sphere and plane.
    motion : ContactMotion
        The file's motion at every state that was read.
    symptoms : Symptoms
    theory : ReferenceMotion
        The reference at the compared samples, as far as they go.
    ideal : ReferenceMotion or None
        If the reference slips, the motion with unlimited friction, if there is one.
    path : (n, 4), m
        The file's path as in `UserModel.points` at these samples; NaN after a failure.
    errors : dict of float
        The path error to each rolling model that was tried.
    failure : str or None
        Why the file is wrong whatever its path error.
    judged : bool
        Whether anything moves far enough for a verdict.
    """

    user: UserModel
    accuracy: float
    interval: float
    duration: float
    contact: Any
    motion: ContactMotion
    symptoms: Symptoms
    theory: ReferenceMotion
    ideal: ReferenceMotion | None
    path: Array
    errors: Mapping[Rolling, float]
    failure: str | None
    judged: bool

    @property
    def option(self) -> Any:
        """The options of the file's model."""
        return self.user.robot.model.opt

    @property
    def error(self) -> float:
        """The path error to the reference."""
        return self.errors[self.theory.scene.rolling]

    @property
    def friction_worth(self) -> float:
        """The distance of the reference from rolling with unlimited friction, as a path error."""
        return np.inf if self.ideal is None else path_error(_path_of(self.theory), self.ideal)

    @property
    def since(self) -> float | None:
        """The first sample at which the path error exceeds the accuracy [s], if any."""
        exceeds = ~(distances(self.path, self.theory) <= self.accuracy)
        return float(self.theory.times[exceeds.argmax()]) if exceeds.any() else None


def observe(
    user: UserModel, rolling: Rolling | None, duration: float, accuracy: float, show: Show
) -> Observation:
    """Run a model as its file says over a duration [s], and compare it with its reference.

    Raises InputError for a timestep that is too short, or without a reference.
    """
    user = replace(user, robot=_with_possible_inertias(user.robot))
    robot, contact = user.robot, user.robot.contact(user.begin())
    step, least = robot.model.opt.timestep, _SHORTEST_STEP
    if step < least:
        raise InputError(f"{robot.path}: timestep must be at least {least:g} s, not {step:g} s")
    steps = max(1, round(_READ_INTERVAL / step))
    every = max(1, round(_INTERVAL / (steps * step)))
    interval = every * steps * step
    times = interval * np.arange(max(2, round(duration / interval) + 1))
    duration = float(times[-1])
    default = rolling_of(contact)
    scene, watch = user.scene(default, duration), lambda part: show(0.3 * part, "file")
    name = "repaired" if robot.repairs else "unmodified"
    motion, symptoms = observed(user, scene, accuracy, steps, watch, name)
    if not symptoms.failure:  # the run may have been given up
        times = times[: max(2, 1 + (len(symptoms.path) - 1) // every)]
    path = np.full((len(times), 4), np.nan)
    sampled = symptoms.path[::every][: len(times)]
    path[: len(sampled)] = sampled
    models = [rolling] if rolling else sorted(get_args(Rolling), key=lambda it: it != default)
    rtol = max(_REFERENCE_ERROR * accuracy, LEAST_RTOL)
    with named(f"{robot.path}: {symptoms.failure}" if symptoms.diverged else robot.path):
        theories = _references(user, models, path, times, rtol, show)
    errors = {name: path_error(path[: len(it.times)], it) for name, it in theories.items()}
    nearest = min(errors, key=lambda name: errors[name] / (1.0 if name == default else _NEARER))
    theory = theories[nearest]
    ideal = None
    if theory.slipping:
        with contextlib.suppress(InputError, _SlowError):
            ideal = _integrated(theory.scene.ideal, theory.times, rtol, show)
    path, end = path[: len(theory.times)], theory.times[-1]
    if theory.slipping and symptoms.hops:  # an error of the contact, not a flight
        symptoms = replace(symptoms, failure=None, until=float(motion.times[-1]))
    longest = max(_reach(path), theory.path_length, np.abs(_path_of(theory)[:, 3]).max())
    judged = symptoms.failure is not None or longest >= _LEAST_PATH * user.robot.radius
    failure = symptoms.failure
    if failure:
        path[theory.times >= symptoms.until] = np.nan
    elif path[0, 2] < -ALOFT_HEIGHT * robot.radius:
        failure = f"starts {-path[0, 2]:.3g} m below the plane's surface"
    elif (sunk := -np.nanmin(path[:, 2])) > _SUNK * robot.radius:
        failure = f"sinks {sunk:.2g} m into the plane"
    elif impossible := [it.words for it in unusual_inertias(robot) if it.is_impossible]:
        failure = f"no body can have these numbers: {impossible[0]}"
    elif not judged:
        turn = float(np.abs(path[:, 3]).max()) / robot.radius
        spins = f"spins on the spot, by {turn:.3g} rad"
        failure = f"{spins if turn > _LEAST_PATH else 'stands still'}: the file and ideal rolling "
        failure += f"move by less than a tenth of the radius in {end:.3g} s; give a --control"
    elif _is_stuck(path, theory):
        failure = f"stuck. Moved {_reach(path):.2g} m in {end:.3g} s; "
        failure += f"ideal rolling moves {theory.path_length:.3g} m"
    return Observation(
        user, accuracy, interval, duration, contact,
        motion, symptoms, theory, ideal, path, errors, failure, judged,
    )  # fmt: skip


def distances(path: Array, theory: ReferenceMotion, times: Array | None = None) -> Array:
    """Return the distances (k,) of a path (k, 4) from the reference, over its unit of length.

    times (k,): if they are not the first k times of the reference.

    A height above the plane counts as a distance, and so does a turn of the surface if the
    reference spins against friction, or is a ball that spins in place.
    """
    reference = _path_of(theory)
    times = theory.times[: len(path)] if times is None else times
    at = np.column_stack([np.interp(times, theory.times, column) for column in reference.T])
    off = path - at
    off[:, 2] = np.maximum(off[:, 2], 0.0)
    off[:, 3] *= _turns(theory)
    scale = max(theory.path_scale, np.abs(reference[:, 3]).max())
    return np.asarray(np.linalg.norm(off, axis=1)) / scale


def _turns(theory: ReferenceMotion) -> bool:
    """Return whether turns are compared."""
    if theory.slip is not None and theory.slip[:, 2].any():
        return True
    return theory.path_length < _LEAST_PATH * theory.scene.ball.radius and not theory.scene.hinges


def _path_of(theory: ReferenceMotion) -> Array:
    """Return the path (n, 4) of the reference, with turn 0 unless it is compared."""
    path = np.zeros((len(theory.times), 4))
    path[:, :2] = theory.contact_point
    if _turns(theory):
        normal = rotation_matrix(theory.attitude)[:, 2]
        rates = np.einsum("ni,ni->n", normal, theory.angular_velocity)
        path[:, 3] = theory.scene.ball.radius * turned(rates, theory.times)
    return path


def path_error(path: Array, theory: ReferenceMotion) -> float:
    """Return the largest of `distances`; infinite if the path breaks off."""
    return float(np.nan_to_num(distances(path, theory), nan=np.inf).max())


def _reach(path: Array) -> float:
    """Return the largest distance of a path from its start [m]."""
    return float(np.nanmax(np.linalg.norm(path[:, :2], axis=1)))


def _is_stuck(path: Array, theory: ReferenceMotion) -> bool:
    return _reach(path) < _STUCK * _reach(theory.contact_point)


def _references(
    user: UserModel, models: Sequence[Rolling], path: Array, times: Array, rtol: float, show: Show
) -> dict[Rolling, ReferenceMotion]:
    """Return the motion of each rolling model, if it has one. Raises InputError without any.

    Only the first is tried if it takes too long, if it slips as the file's friction says, or if the
    path is stuck and shows no difference.
    """
    theories, refusal = dict[Rolling, ReferenceMotion](), InputError("")
    for rolling in models:
        scene = user.scene(rolling, float(times[-1]))
        try:
            with warnings.catch_warnings(action="ignore", category=SceneWarning):
                theory = _reference(scene, times, rtol, show)
                if is_shock(user, theory) and not scene.start.slips:
                    # A servo jumps to its command: no contact follows the slip of its first steps.
                    theory = _integrated(scene.ideal, times, rtol, show)
                theories[rolling] = theory
        except (InputError, _SlowError) as error:
            causes = (f"; perhaps the {name}: {it}" for name, it in unusual_numbers(user, scene))
            words = str(error).partition(": shorten")[0]
            if "lifts off" in words:
                words += "; a motor, a spring or the start is too strong: lower the control or rate"
            refusal = InputError(f"{words}{''.join(causes)}")
            if isinstance(error, _SlowError):
                break
            continue
        given_up = len(theory.times) < len(times) and not theory.ended
        if given_up or theory.slipping or _is_stuck(path, theory):
            break
    if not theories:
        raise refusal
    return theories


class _SlowError(Exception):
    """The equations take too long."""


def is_shock(user: UserModel, theory: ReferenceMotion) -> bool:
    """Return whether all slip ends within so few steps that no contact follows it."""
    return bool(theory.slipping) and theory.slipping[-1][1] < shock_time(user)


def shock_time(user: UserModel) -> float:
    """Return the time of a model's first few steps [s]."""
    return _SHOCK_STEPS * float(user.robot.model.opt.timestep)


def _reference(scene: Scene, times: Array, rtol: float, show: Show) -> ReferenceMotion:
    """Return the motion of a scene, with unlimited friction if it has none with its own."""
    try:
        return _integrated(scene, times, rtol, show)
    except InputError:
        if not scene.may_slip:
            raise
    return _integrated(scene.ideal, times, rtol, show)


def _integrated(scene: Scene, times: Array, rtol: float, show: Show) -> ReferenceMotion:
    """Return the reference, or the part of it that can be computed in time."""
    began, done = np.inf, 0.0

    def watch(part: float) -> None:
        nonlocal began, done
        now = time.process_time()
        began, done = min(began, now), part
        show(0.3 + 0.1 * part, "equations")
        if now - began > _PATIENCE and part < 0.5:
            speed = f"{_PATIENCE:g} s of processor time for {part * times[-1]:.2g} s of motion"
            cause = "a joint friction or a gain on a light body, or very many bodies"
            raise _SlowError(f"the equations take {speed}; the cause may be {cause}")

    try:
        return integrate(scene, times, rtol, progress=watch)
    except _SlowError:
        count = int(0.8 * done * len(times))
        if count < 2:
            raise
    return integrate(scene, times[:count], rtol)


def made_to_move(user: UserModel) -> tuple[UserModel, list[str]]:
    """Return the model, with controls or a push if nothing moves it, and a line about these."""
    if not _at_rest(user):
        return user, []
    model = user.robot.model
    gravity = float(np.linalg.norm(model.opt.gravity))
    torque = _TORQUE * float(model.body_subtreemass[0]) * gravity * user.robot.radius
    controls: dict[str, Drive] = {}
    for name, gears in gears_of(model).items():
        i, joints = user.actuators[name], [*gears]
        scale = float(model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0])
        _, angle, rate = model.actuator_biasprm[i, :3]
        value = _ANGLE if angle else _RATE if rate else torque / (abs(scale) or 1.0)
        if model.actuator_ctrllimited[i]:
            low, high = (float(end) for end in model.actuator_ctrlrange[i])
            value = min(value, high / 4) if high > 0 else max(-value, low / 4)
        slides = np.any(model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_SLIDE))
        if slides or (np.any(model.jnt_limited[joints]) and not angle):
            value = 0.0  # it would soon reach the end of its range
        controls[name] = Constant(value)
    if not any(drive.rate(0.0) for drive in controls.values()):
        speed = float(np.sqrt(gravity * user.robot.radius)) / 2
        line = f"No control given; check used a push, to roll at {speed:.2g} m/s."
        return replace(user, push=speed), [line]
    used = ", ".join(f"{name}={drive.rate(0.0):.3g}" for name, drive in controls.items())
    line = f"No control given; check used {used}. "
    line += f"Choose your own with --control {next(iter(controls))}=VALUE."
    return replace(user, controls=controls), [line]


def _at_rest(user: UserModel) -> bool:
    """Return whether a model without controls and velocities stays in place.

    For about 2 s, or 20 000 steps if these are fewer.
    """
    data, step = user.begin(), user.robot.model.opt.timestep
    if user.controls or np.any(data.ctrl) or np.any(data.qvel):
        return False
    path = user.path(step * min(1 + round(0.1 / step), 1000) * np.arange(20))
    return bool(np.nanmax(np.abs(path[:, :2])) < _AT_REST * user.robot.radius)


def resistance_per_deceleration(scene: Scene) -> float | None:
    """Return the rolling friction [m] that slows a ball down by 1 m/s²: a(1 + k)/g.

    None for a robot with joints, on a slope, or with its centre of mass off the sphere's.
    """
    if scene.hinges or not scene.level or imbalance(scene.ball):
        return None
    momentum = scene.momentum_of(scene.start.to_world.T @ [1.0, 0.0, 0.0])
    return float(np.linalg.norm(momentum)) / (scene.ball.mass * scene.gravity * scene.ball.radius)


def unusual_numbers(user: UserModel, scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield each unusual setting, and its number beside the usual one.

    Settings that affect the whole robot come first.
    """
    yield from (("inertia", inertia.words) for inertia in unusual_inertias(user.robot))
    yield from _wrong_gains(scene)
    density = scene.ball.mass / (4 / 3 * np.pi * scene.ball.radius**3)
    if density > _DENSEST:
        words = f"the robot has {scene.ball.mass:.3g} kg in a sphere of {scene.ball.radius:.3g} m"
        yield "mass", f"{words}: {density:.3g} kg/m³; the densest metal has {_DENSEST:g} kg/m³"
    yield from (("range", words) for words in _inverted_ranges(user.robot.model))
    if abs(scene.gravity / GRAVITY - 1) > _GRAVITY:
        yield "gravity", f"{scene.gravity:g} m/s², but the Earth has {GRAVITY:g} m/s²"
    level = np.allclose(user.robot.plane_axes(user.begin()), np.eye(3))
    if level and scene.gravity_direction != DOWN:
        tilt = np.degrees(np.arccos(-scene.gravity_direction[2]))
        yield "gravity", f"gravity is tilted by {tilt:.3g} deg, but the plane is level"
    rolling, radius = scene.friction.rolling, scene.ball.radius
    if rolling > _ROLLING_FRICTION * radius:
        words = f"declared rolling friction is {rolling:g} m, {rolling / radius:.0%} of the radius"
        yield "resistance", words
    yield from (("range", words) for words in _ranges_of_many_turns(user.robot.model))
    yield from _unusual_gears(scene)


def _wrong_gains(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield actuators without a gain, and servos that drive a joint away from their command."""
    for actuator in scene.actuators:
        if not (actuator.law.per_command or actuator.law.at_rest):
            yield "gain", f"{actuator.name} exerts no force, because its gain is 0"
        for kind, gain in (("kp", actuator.law.per_angle), ("kv", actuator.law.per_rate)):
            if gain < 0:
                words = f"{actuator.name}: {kind} = {gain:.3g} is negative"
                yield "gain", f"{words}, so the joint moves away from the command"


def _unusual_gears(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield tiny gears, and gears with a lasting torque that no weight inside can balance."""
    inside = {link.name: link for link in scene.ball.tree[1:]}
    levers = sum(link.mass * float(np.linalg.norm(link.centre)) for link in inside.values())
    times = np.linspace(0.0, scene.duration, 101)
    for actuator in scene.actuators:
        law, command = actuator.law, as_drive(actuator.command, scene.duration)
        # The torque of a servo falls with its error; the torque of a motor lasts.
        lasts = not (law.per_angle or law.per_rate)
        torque = float(np.abs(law.torque(command.rate(times), 0.0, 0.0)).max())
        for name, gear in actuator.gears:
            slides = inside[name].slides
            load, unit = torque * abs(gear), "N" if slides else "N m"
            weight = scene.gravity * (inside[name].mass if slides else levers)
            if lasts and load > weight > 0:
                words = f"exerts {load:.3g} {unit} on {name} with a gear of {gear:g}; the weights "
                words += f"exert at most {weight:.3g} {unit}"
                yield "gear", f"{actuator.name} {words}"
            elif abs(gear) <= _SMALL_GEAR:
                only = f"with a gear of only {gear:g}" if gear else "not at all: its gear is 0"
                yield "gear", f"{actuator.name} moves {name} {only}"


def _ranges_of_many_turns(model: Any) -> Iterator[str]:
    """Yield ranges of hinges, in rad, that would be usual in degrees."""
    limited = (model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)) & (model.jnt_limited != 0)
    for i in np.flatnonzero(limited).tolist():
        low, high = model.jnt_range[i]
        if (turns := (high - low) / (2 * np.pi)) > _TURNS:
            name = model.joint(i).name
            words = f"{name} has the range {low:g} to {high:g} rad, which is {turns:.3g} turns"
            yield f'{words}; if these are degrees, the compiler needs angle="degree"'


def _extent(model: Any, data: Any, body: int, point: Array) -> float:
    """Return the largest distance of a body's geoms from a point (3,), 0 without geoms [m]."""
    geoms = np.flatnonzero(model.geom_bodyid == body)
    away = np.linalg.norm(data.geom_xpos[geoms] - point, axis=1)
    return float((away + model.geom_rbound[geoms]).max(initial=0.0))


class _Inertia(NamedTuple):
    """A body with an unusual inertia, and a moment [kg m²] in place of an impossible one."""

    body: int
    words: str
    is_impossible: bool = False
    moment: float | None = None


def unusual_inertias(robot: RobotFile) -> Iterator[_Inertia]:
    """Yield each body with a moment of inertia, or a centre, that is impossible or unusual.

    A mass m within the distance r of the sphere's centre has at most the moment m (r² - c²) about
    any axis through its centre of mass, which is at the distance c. The geoms of a body and the
    sphere give r; the geoms alone give the moment of a solid ball, for a body with an inertial.
    """
    model, data = robot.model, robot.start()
    for body in np.flatnonzero(model.body_rootid == robot.root).tolist():
        name, mass = body_name(model, body), float(model.body_mass[body])
        middle, place = data.geom_xpos[robot.sphere], data.xipos[body]
        away = float(np.linalg.norm(place - middle))
        reach = max(robot.radius, _extent(model, data, body, middle))
        moment, most = float(model.body_inertia[body].max()), mass * (reach**2 - away**2)
        solid = 2 / 5 * mass * _extent(model, data, body, place) ** 2
        of = f"{name} has a moment of inertia of {moment:.3g} kg m²"
        if away > reach and mass:
            words = f"{name} has its centre of mass {away:.3g} m from the middle of the sphere"
            yield _Inertia(body, f"{words}, but sphere and geoms reach only {reach:.3g} m", True)
        elif moment > most * (1 + _ROUNDING):
            usual = min(solid or np.inf, 2 / 5 * most)
            words = f"{of}; {mass:.3g} kg within {reach:.3g} m have at most {most:.2g}, "
            yield _Inertia(body, f"{words}and a solid ball has {usual:.2g}", True, usual)
        elif mass and (far := np.sqrt(moment / mass + away**2)) > _FAR * robot.radius:
            words = f"the mass of {name} is {far:.3g} m from the middle of the sphere"
            yield _Inertia(body, f"{words}; the sphere's radius is {robot.radius:.3g} m")
        elif robot.spec.bodies[body].explicitinertial and moment < _SMALL_INERTIA * solid:
            yield _Inertia(body, f"{of}; a solid ball of its mass and size has {solid:.2g}")


def _with_possible_inertias(robot: RobotFile) -> RobotFile:
    """Return a robot with the inertia of a solid ball in place of an impossible <inertial>."""
    spec, words = robot.spec.copy(), list[str]()
    for body, fault, _, moment in unusual_inertias(robot):
        if moment and spec.bodies[body].explicitinertial:
            spec.bodies[body].inertia, spec.bodies[body].fullinertia[0] = 3 * [moment], np.nan
            words.append(f"{fault}, which the mended file has as a placeholder")
    if not words:
        return robot
    repairs = {**robot.repairs, "inertia": "; ".join(words)}
    return replace(robot, spec=spec, model=spec.compile(), repairs=repairs)


def _inverted_ranges(model: Any) -> Iterator[str]:
    """Yield ranges that MuJoCo ignores, because the first end is not below the second."""
    for field in ("jnt_range", "jnt_actfrcrange", "actuator_ctrlrange", "actuator_forcerange"):
        owner, kind = field.replace("actfrc", "actuatorfrc").split("_")
        for i, (low, high) in enumerate(getattr(model, field)):
            if low > high:
                name = (model.joint if owner == "jnt" else model.actuator)(i).name
                yield f"{name} has the inverted {kind} {low:g} to {high:g}, which has no effect"
