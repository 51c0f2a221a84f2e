"""Propose changes to a user's file. Each is a law that compares the file with what rolling needs.

A law names the number of the file beside the number that the motion needs, or beside the limit that
it exceeds. `ablate` finds out which of the changes are needed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import mujoco
import numpy as np

from robotball.engines.mujoco.model import friction_reference
from robotball.engines.mujoco.settings import CONSTANT, INTEGRATORS, for_slip, recipe
from robotball.engines.mujoco.user_model import UserModel, wrenches
from robotball.engines.observe import depth_at_rest
from robotball.errors import counted
from robotball.motion import ReferenceMotion
from robotball.robot.drives import as_drive
from robotball.rotations import Array
from robotball.user_model.mended_file import Change, Editable, StartShift, editable
from robotball.user_model.robot_file import body_name, default_class, geom_name, start_misses

from .observe import Observation, shock_time

# The recipe has more friction than any motion needs, and the hardest contact that MuJoCo does not
# soften: MuJoCo raises the time constant to two steps.
_SLIDING: float = CONSTANT["sliding_friction"]
_TIME_CONSTANT = 0.004  # s, twice MuJoCo's default timestep
_SOLIMP: Any = recipe("mended", 1e-3).solimp
_LARGEST_MARGIN = 1e-2  # of the radius: a larger result is not meaningful
_SAME_DEPTH = 1e-8  # m, the tolerance of a margin
# The solver of the recipe, and the values beyond which a solver stops early.
_SOLVER = {"solver": "Newton", "iterations": "100", "ls_iterations": "50", "tolerance": "1e-10"}
_ITERATIONS, _LS_ITERATIONS, _TOLERANCE = 20, 10, 1e-8
_DELIVERED = 0.95  # of the declared rolling resistance: more is not worth a word
_OVERRIDDEN = ("margin", "solref", "solimp", "friction")  # by the option flag override
_EULER_ID, _RK4_ID = map(int, (mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4))
# Largest stable stiffness·dt²/I, of the leapfrog scheme of Euler and the implicit ones, and of RK4.
_SPRING_LIMITS = {"EULER": 4.0, "RK4": 8.0}
_SHORTEST_STEP = 1e-4  # s, of trials
_EXPLICIT = {_EULER_ID: INTEGRATORS["Euler"], _RK4_ID: INTEGRATORS["RK4"]}
_SAME_SLIP = 1e-3  # of the slip of a start: what may be left of it
_SLIP = 1e-3  # of a start's speed: less is a rounding of its numbers
_LIMITED = 0.5  # of the time: a servo may meet its limit for less while it starts
_MOST_PAIRS = 5  # of geoms that are named


def editable_file(seen: Observation) -> Editable:
    """Return the text of the observed file, ready for changes."""
    user, contact = seen.user, seen.contact
    robot, data = user.robot, user.begin()
    normal, gap = robot.above_plane(data)
    slip = robot.slip(data, seen.theory.scene.start.slip)
    moves = StartShift(-gap * normal, -slip, robot.keyframe(user.key))
    names = ("condim", "friction", "solref", "solreffriction", "solimp", "margin")
    called = {"condim": "dim", "margin": "includemargin"}  # in a contact
    fields = {name: np.atleast_1d(getattr(contact, called.get(name, name))) for name in names}
    # A value of zeros is the default.
    pair = {name: _digits(*values) for name, values in fields.items() if np.any(values)}
    overlapping = {geom for pair in seen.symptoms.inside for geom in pair}
    return editable(robot, moves, pair, {int(robot.model.geom_bodyid[i]) for i in overlapping})


def proposals(
    seen: Observation, edit: Editable, step: float, implicit: bool = True
) -> list[Change]:
    """Return the changes after which the file follows the recipe, with steps of a length [s].

    Changes that hide the effect of others come first, fine points last. implicit: whether to take
    implicitfast for a gain that is too high for the file's integrator.
    """
    timestep, friction_loss = partial(_timestep, step=step), partial(_frictionloss, step=step)
    gain = too_high_gain(seen.user)
    integrator = _gain if implicit and gain and gain.step is None else _integrator
    laws = [_contacts, _start, _solver, _condim, _cone]
    if seen.theory.slipping:
        laws += [integrator, timestep, partial(_slip, step=step), friction_loss]
    else:
        laws += [_friction, integrator, timestep, _softness, _noslip, friction_loss]
    changes = [change for law in laws for change in law(seen)]
    if seen.option.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        changes = [_overriding(change) for change in changes]
    return _with_margin(changes, seen, edit)


def _digits(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _contacts(seen: Observation) -> Iterator[Change]:
    """Bodies inside the shell collide, although they should pass through one another."""
    model, inside = seen.user.robot.model, seen.symptoms.inside
    if inside:
        more = len(inside) - 1
        others = f", and {counted(more, 'more pair')}" if more else ""
        bodies = {tuple(sorted(int(model.geom_bodyid[geom]) for geom in pair)) for pair in inside}
        names = tuple((body_name(model, i), body_name(model, j)) for i, j in sorted(bodies))
        yield Change("contacts", next(collisions(seen)) + others, exclude=names)


def collisions(seen: Observation) -> Iterator[str]:
    """Yield which geoms collide inside the shell, and how often, the most frequent first."""
    for pair, part in seen.symptoms.inside.most_common(_MOST_PAIRS):
        a, b = (geom_name(seen.user.robot.model, geom) for geom in pair)
        yield f"{a} touches {b} in {part:.0%} of the steps"


class _Gain(NamedTuple):
    """A gain too high for an integrator, over its stable limit, and the longest stable step [s].

    The step is None for forces along a rate, which are stable with implicitfast at any step.
    """

    excess: float
    words: str
    step: float | None


def too_high_gain(user: UserModel) -> _Gain | None:
    """Return the gain, stiffness or damping that is highest above the stable limit, if any.

    They are measured by the inertia that they move at the start.
    """
    model = user.robot.model
    scheme = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_")
    integrator = _EXPLICIT.get(model.opt.integrator)
    limits = {
        1: integrator.servo_limit if integrator else None,
        2: _SPRING_LIMITS.get(scheme, _SPRING_LIMITS["EULER"]),
    }
    step, gains = model.opt.timestep, []
    for name, kind, value, gear, power, mobility in _feedback(user):
        limit = limits[power]
        if limit is None or (number := value * gear**2 * step**power * mobility) <= limit:
            continue
        square, geared = "²" * (power - 1), kind in ("kv", "kp")
        factors = f"{value:.3g}" + f"·{gear:.3g}²" * geared + f"·{step:.3g}{square}"
        words = f"{name}: {kind}{'·gear²' * geared}·dt{square}/I = {factors}/{1 / mobility:.3g} = "
        words += f"{number:.3g}; "
        words += f"{integrator.name if integrator else scheme.lower()} is stable below {limit:.3g}"
        stable = None if power == 1 else step * (limit / number) ** 0.5
        gains.append(_Gain(number / limit, words, stable))
    return max(gains, default=None)


def _feedback(user: UserModel) -> Iterator[tuple[str, str, float, float, int, float]]:
    """Yield forces that oppose a rate (1) or an angle (2): names, gain, gear, which, and 1/I."""
    model, data = user.robot.model, user.begin()

    def mobility(moment: Array) -> float:
        accelerations = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, accelerations, moment[None])
        return float(moment @ accelerations[0])

    moments = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moments, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    for name, i in user.actuators.items():
        if gear := float(model.actuator_gear[i, 0]):
            inverse = mobility(moments[i]) / gear**2
            _, kp, kv = (-model.actuator_biasprm[i, :3]).tolist()
            yield name, "kv", kv, gear, 1, inverse
            yield name, "kp", kp, gear, 2, inverse
    for joint in np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)).tolist():
        dof, name = int(model.jnt_dofadr[joint]), model.joint(joint).name or f"joint {joint}"
        inverse = mobility(np.eye(model.nv)[dof])
        if model.opt.integrator == _RK4_ID:  # other integrators take damping implicitly
            yield name, "damping", float(model.dof_damping[dof]), 1.0, 1, inverse
        yield name, "stiffness", float(np.ravel(model.jnt_stiffness[joint])[0]), 1.0, 2, inverse


def steps_of(user: UserModel, longest: float = _TIME_CONSTANT / 2) -> list[float]:
    """Return timesteps for trials [s], each half of the one before: the file's if possible.

    No stiffness is too high for them. longest: of a step that does not soften the contact.
    """
    gain, step = too_high_gain(user), float(user.robot.model.opt.timestep)
    longest = min(longest, gain.step if gain and gain.step else np.inf)
    while step > max(longest, _SHORTEST_STEP):
        step /= 2
    count = 1 + int(np.log2(max(step / _SHORTEST_STEP, 1.0)))
    return [step / 2**i for i in range(count)]


def _gain(seen: Observation) -> Iterator[Change]:
    """An explicit integrator is unstable under a high gain; implicitfast is stable at any."""
    if gain := too_high_gain(seen.user):
        words = f"{gain.words}; implicitfast is stable at any gain"
        yield Change("gain", words, option={"integrator": "implicitfast"})


def _start(seen: Observation) -> Iterator[Change]:
    """The start is off the plane, or slips and the reference does not."""
    kept = seen.theory.scene.start.slip
    if misses := [miss for miss, _ in start_misses(seen.user.robot, seen.user.begin(), kept)]:
        yield Change("start", "; ".join(misses), start=True)


def _solver(seen: Observation) -> Iterator[Change]:
    """The solver stops before the contact forces have converged."""
    option = seen.option
    stops_early = {
        "solver": option.solver != int(mujoco.mjtSolver.mjSOL_NEWTON),
        "iterations": option.iterations < _ITERATIONS,
        "ls_iterations": option.ls_iterations < _LS_ITERATIONS,
        "tolerance": option.tolerance > _TOLERANCE,
    }
    if changed := {name: _SOLVER[name] for name, stops in stops_early.items() if stops}:
        words = f"the solver stops early: iterations {option.iterations}, "
        words += f"ls_iterations {option.ls_iterations}, tolerance {option.tolerance:g}"
        yield Change("solver", words, option=changed)


def _condim(seen: Observation) -> Iterator[Change]:
    """Each rolling model has its number of friction directions."""
    condim, scene = seen.contact.dim, seen.theory.scene
    needed = 6 if scene.friction.rolling else 4 if scene.rolling == "rubber" else 3
    if condim != needed:
        free = "allows slip" if condim == 1 else "allows spin"
        effect = free if condim < needed else "resists more than it should"
        words = f"condim {condim} {effect}; {scene.rolling} rolling needs condim {needed}"
        words += default_class(seen.user.robot, "condim")
        yield Change("condim", words, pair={"condim": str(needed)})


def _cone(seen: Observation) -> Iterator[Change]:
    """A pyramidal cone couples the directions of friction, and weakens rolling resistance."""
    if seen.option.cone != int(mujoco.mjtCone.mjCONE_ELLIPTIC):
        words = "the friction cone is a pyramid, so that friction is not opposite to the slip"
        delivered = seen.symptoms.delivered
        if delivered is not None and delivered < _DELIVERED:
            words += f" and delivers {delivered:.0%} of the rolling resistance"
        yield Change("cone", words, option={"cone": "elliptic"})


def _friction(seen: Observation) -> Iterator[Change]:
    """The sphere slips if the reference needs more friction. Classical rolling has no torsion."""
    scene = seen.theory.scene
    slide, _, spin, roll, _ = seen.contact.friction
    torsional, rubber = mujoco.mjMINMU, scene.rolling == "rubber"
    if rubber:
        torsional = _SLIDING * scene.ball.radius
    if slide < _SLIDING or ((rubber or scene.friction.rolling) and spin != torsional):
        values = _digits(_SLIDING, _SLIDING, torsional, roll, roll)
        words, needs = needed_friction(seen), _needs(seen)
        if needs[0] <= slide and needs[1] <= spin:
            words = f"regularized friction creeps with a sliding friction of {slide:.3g}"
            words += f" and a torsional friction of {spin:.3g} m" * rubber
        yield Change("friction", words, pair={"friction": values})


def _needs(seen: Observation) -> tuple[float, float]:
    """Return the sliding and torsional friction that rolling needs."""
    motion = seen.ideal or seen.theory
    needs = motion.loads.sliding_friction, motion.loads.torsional_friction
    jumps = not seen.theory.slipping and needs[0].max() > seen.contact.friction[0]
    # A servo may jump to its command.
    later = motion.times >= min(jumps * shock_time(seen.user), motion.times[-1])
    sliding, torsional = (round(float(need[later].max()), 6) for need in needs)
    return sliding, torsional


def needed_friction(seen: Observation) -> str:
    """Return the friction of the file, and the friction that rolling needs, in words."""
    slide, _, spin, *_ = seen.contact.friction
    sliding, torsional = _needs(seen)
    words = f"sliding friction {slide:.3g}; rolling needs {sliding:.2g}{_jump(seen, sliding)}"
    rubber = seen.theory.scene.rolling == "rubber"
    more = f"; torsional friction {spin:.3g} m; rolling needs {torsional:.2g} m"
    return words + more * rubber


def _jump(seen: Observation, needed: float) -> str:
    """Return the servo whose jump to its command needs this friction at t = 0, in words, or ""."""
    model, data = seen.user.robot.model, seen.user.begin()
    mujoco.mj_forward(model, data)
    forces = np.abs(data.actuator_force * model.actuator_gear[:, 0]) * (model.actuator_biastype > 0)
    friction = (seen.ideal or seen.theory).loads.sliding_friction
    lasts = friction[0] < (1 - _SAME_SLIP) * needed or np.median(friction) > needed / 2
    if lasts or not forces.any():
        return ""
    name, force = [*seen.user.actuators][forces.argmax()], forces.max()
    return f" at t = 0, because {name} jumps to its command (a force or torque of {force:.3g})"


def limited_actuators(theory: ReferenceMotion) -> Iterator[tuple[str, str]]:
    """Yield which of its ranges limits an actuator for most of the time, and the numbers."""
    scene, joints = theory.scene, [link.name for link in theory.scene.ball.tree[1:]]
    # An asymmetric range is a symmetric limit about a constant force.
    middles = {actuator.name: actuator.law.at_rest for actuator in scene.actuators}
    for actuator in scene.actuators:
        name, law = actuator.name, actuator.law
        commands = as_drive(actuator.command, scene.duration).rate(theory.times)
        clipped = np.clip(commands, *actuator.within)
        if (beyond := clipped != commands).any():
            asked, limit = (values[np.argmax(beyond)] for values in (commands, clipped))
            yield "ctrlrange", f"{name} is {asked:.3g}, but ctrlrange limits it to {limit:.3g}"
        at = [joints.index(joint) for joint, _ in actuator.gears]
        ratios = [ratio for _, ratio in actuator.gears]
        angles, rates = theory.hinge_angles[:, at] @ ratios, theory.hinge_rates[:, at] @ ratios
        signal = as_drive(actuator.control(scene.duration), scene.duration)
        signals = np.array([float(signal.rate(t)) for t in theory.times.tolist()])
        forces = law.unlimited(signals, angles, rates)
        if (part := float((np.abs(forces) > law.limit).mean())) > _LIMITED:
            middle, most = middles.get(f"{name}_offset", 0.0), forces[np.abs(forces).argmax()]
            words = f"{name} commands up to {middle + most:.3g}; for {part:.0%} of the time its "
            words += f"forcerange or actuatorfrcrange allows only {middle - law.limit:.3g} to "
            yield "forcerange", f"{words}{middle + law.limit:.3g}"


def slip_causes(seen: Observation) -> Iterator[tuple[str, str]]:
    """Yield why the reference slips: friction below what rolling needs, and the start."""
    scene, ideal = seen.theory.scene, seen.ideal
    if not seen.theory.slipping:
        return
    if ideal is None or ideal.loads.grip(scene.slip_limits).max() > 1:
        yield "friction", f"it slips, because its friction is too small: {needed_friction(seen)}"
    if scene.start.slips:
        *slip, spin = scene.start.slip.tolist()
        moving, slides = seen.user.robot.moving(seen.user.begin()), float(np.hypot(*slip))
        fast = float(np.linalg.norm(moving[3:]) + scene.ball.radius * np.linalg.norm(moving[:3]))
        speeds = [f"its contact point slips at {slides:.3g} m/s"] * (slides > _SLIP * fast)
        speeds += [f"it starts with a spin of {spin:.3g} rad/s"] * bool(spin)
        if speeds and _rolls_in_world_axes(seen.user):
            read = "its angular velocity seems to be in world axes, but qvel has body axes"
            yield "axes", f"{' and '.join(speeds)}; {read}"
        elif speeds:
            yield "start", " and ".join(speeds)


def _rolls_in_world_axes(user: UserModel) -> bool:
    """Return whether a start that slips rolls if its angular velocity is read in world axes."""
    robot, data = user.robot, user.begin()
    turning = data.qvel[robot.drift.stop :][:3]
    change = turning - data.xmat[robot.root].reshape(3, 3) @ turning
    slip, normal = robot.slip(data), robot.above_plane(data)[0]
    left = slip - robot.radius * np.cross(change, normal)
    return bool(np.linalg.norm(left) < _SAME_SLIP * np.linalg.norm(slip))


def _slip(seen: Observation, step: float) -> Iterator[Change]:
    """A contact as hard as for rolling lifts a sphere that slips, and it sticks too late."""
    # Euler's damping of slip is stable with RK4, too.
    euler = recipe("mended", seen.accuracy, integrator="Euler")
    settings: Any = for_slip(seen.theory.scene, euler, step)
    names = ("solref", "solimp", "solreffriction")
    values = {name: _digits(*getattr(settings, name)) for name in names}
    aside = ", pulls it aside" * (seen.option.cone != int(mujoco.mjtCone.mjCONE_ELLIPTIC))
    words = f"the contact violates Coulomb's law: it lifts a slipping sphere{aside}"
    words += ", and ends the slip too late"
    option = {"cone": "elliptic", "impratio": _digits(settings.impratio)}
    yield Change("slip", words, pair=values, option=option)


def _integrator(seen: Observation) -> Iterator[Change]:
    """An integrator other than RK4 is of first order."""
    if seen.option.integrator != _RK4_ID:
        yield Change("integrator", "the integrator is of first order", option={"integrator": "RK4"})


def _timestep(seen: Observation, step: float) -> Iterator[Change]:
    """Shorter steps reduce the error of the integrator, and do not soften the contact."""
    if step < seen.option.timestep:
        gain = too_high_gain(seen.user)
        words = f"steps of {1e3 * seen.option.timestep:g} ms are too long"
        words += f" for the gain of {gain.words}" if gain else ""
        cures = gain and (gain.step or gain.excess * step < seen.option.timestep)
        name = "gain" if cures else "timestep"
        yield Change(name, words, option={"timestep": _digits(step)})


def _softness(seen: Observation) -> Iterator[Change]:
    """A sphere of radius a that sinks or floats by p has a path error of 0.54 p/a (measured)."""
    times, depth = seen.motion.times, seen.motion.report.depth
    depth = depth[(times < seen.symptoms.until) & np.isfinite(depth)]
    known = len(depth) and not seen.symptoms.diverged
    sinks = 1e3 * float(depth.mean()) if known else 0.0
    by = f": the sphere sinks {sinks:.2g} mm" if known else ""
    name, words = "softness", f"the contact is soft{by}, and carries no load at first"
    if sinks < 0:
        name, words = "margin", f"its margin holds the sphere {-sinks:.2g} mm above the plane"
    words += default_class(seen.user.robot, "margin" if sinks < 0 else "solref")
    hard = {"solref": _digits(_TIME_CONSTANT, 1.0), "solimp": _digits(*_SOLIMP)}
    yield Change(name, words, pair=hard)


def _noslip(seen: Observation) -> Iterator[Change]:
    """Regularized friction creeps under a load, unless MuJoCo solves for the slip."""
    if seen.option.noslip_iterations < 1:
        words = "friction is regularized and creeps; no iterations remove the slip"
        yield Change("noslip", words, option={"noslip_iterations": "3"})


def _frictionloss(seen: Observation, step: float) -> Iterator[Change]:
    """Dry friction is a soft row, which acts along a rate before a load reverses it."""
    if np.any(seen.user.robot.model.dof_frictionloss):
        hard = friction_reference(min(step, seen.option.timestep))
        words = "frictionloss is soft and acts along a rate shortly before a load reverses it"
        yield Change("frictionloss", words, joint={"solreffriction": _digits(*hard)})


def _overriding(change: Change) -> Change:
    """Return a change that also sets the options `o_margin` and so on, as its pair.

    MuJoCo's flag "override" takes these options in place of the values of a pair.
    """
    options = {f"o_{name}": change.pair[name] for name in _OVERRIDDEN if name in change.pair}
    if not options:
        return change
    words = f"{change.words}; set by the option flag override"
    return replace(change, words=words, option={**change.option, **options})


def _with_margin(changes: Sequence[Change], seen: Observation, edit: Editable) -> list[Change]:
    """Return the changes with the margin at which the contact carries the load from the start.

    A sphere that just touches has no normal force at first, and slips by 1e-3 of the path or more.
    """
    theory, user = seen.theory, seen.user.with_text(edit.changed(changes))
    robot, data, model = user.robot, user.begin(), user.robot.model
    load = float(theory.loads.contact_force[0, 2])
    pairs = np.flatnonzero((model.pair_geom1 == robot.sphere) | (model.pair_geom2 == robot.sphere))

    def excess(margin: float) -> float:
        model.pair_margin[pairs] = model.opt.o_margin = margin
        mujoco.mj_forward(model, data)
        return float(sum(wrench[0] for _, wrench in wrenches(robot, data))) - load

    # The static penetration of a contact with the impedance d: g (1 - d) timeconst². A negative
    # value is the stiffness of a contact with a low impedance.
    impedance, settles = model.pair_solimp[pairs[0], 1], model.pair_solref[pairs[0], 0]
    square = settles**2 if settles > 0 else -1 / settles
    guess = theory.scene.gravity * float((1 - impedance) * square)
    root = depth_at_rest(excess, guess, 1.1 * guess, _SAME_DEPTH)
    if not 0 < root < _LARGEST_MARGIN * theory.scene.ball.radius:
        return [*changes]
    margin = {"margin": _digits(root)}
    return [
        replace(change, pair={**change.pair, **margin}) if "solref" in change.pair else change
        for change in changes
    ]
