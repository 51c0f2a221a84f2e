"""Check a user's own model: does it roll right as it is, and if not, which line of it is wrong?

Its model is stepped by plain `mj_step`, as the file says, beside ideal rolling of the same tree.
It is right if it rolls all the time in contact, moves, and keeps to the accuracy. Else the choices
of the recipe are made in it, and the fewest that reach the accuracy are found by leaving out one
after the other. The cause is the one without which the error is largest.
"""

import difflib
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

import mujoco
import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from scipy.optimize import root_scalar

from robotball import InputError, Scene, integrate
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.settings import BY_ERROR, CONSTANT, recipe
from robotball.engines.mujoco.user_model import (
    Gain,
    Met,
    Seen,
    UserModel,
    observed,
    too_high_gain,
    wrenches,
)
from robotball.errors import SceneWarning, mujoco_silent
from robotball.motion import (
    ContactMotion,
    Motion,
    ReferenceMotion,
    arrays_of,
    measured_time,
    with_arrays,
)
from robotball.robot.drives import Constant, Drive, as_drive
from robotball.robot.formulas import Rolling
from robotball.robot.scene import DOWN, GRAVITY
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL
from robotball.user_model.mended_file import Change, Editable, Moves, compiled, editable
from robotball.user_model.robot_file import body_name, gears_of, geom_name, rolling_of, start_misses
from robotball.view.lines import PRESET_LOOKS

from ..output import Show, known, scientific, title
from ..study import Column, Study, table_of

_INTERVAL = 0.01  # s between the points that are compared, or the model's own step
_LOOK = 1e-3  # s between the states whose contacts are looked at, or the model's own step
_LEAST_STEP = 1e-4  # s, the shortest that is tried
_SHORTEST = 1e-7  # s, of a file's own step: 10 s of a shorter one take many minutes
_STANDS = 1e-3  # of the radius: a robot that rolls less in all is moved
_LEAST_PATH = 0.1  # of the radius: less is no verdict
_STILL = 0.05  # of the equations' reach: a robot that gets no farther stands still
_PATIENCE = 20.0  # s of processor time for the equations, and for all that is tried
# Controls of a robot that would not move: rad, rad/s, and of the weight at the radius.
_ANGLE, _RATE, _TORQUE = 0.3, 2.0, 0.03
# Of the accuracy: what a step of the equations may be off. In 10 s they err by 1e-6 to 1e-5 of the
# accuracy then, far less than any contact does.
_OF_ACCURACY = 1e-6
_NEARER = 0.5  # times the other's error: a rolling model so near is the one that the file has


# The recipe's: friction beyond any demand, and a contact as hard as MuJoCo's own steps take, whose
# time constant [s] is two steps at least.
_SLIDE, _SOFTEST = CONSTANT["sliding_friction"], BY_ERROR[1]
_SOLIMP: Any = recipe("mended", 1e-3).solimp


def _digits(*values: float) -> str:
    return " ".join(f"{each:.9g}" for each in values)


def _pair_of(contact: Any) -> dict[str, str]:
    """Return the attributes of a pair that makes this contact."""
    names = ("condim", "friction", "solref", "solreffriction", "solimp", "margin")
    called = {"condim": "dim", "margin": "includemargin"}  # among a contact's data
    values = {name: np.atleast_1d(getattr(contact, called.get(name, name))) for name in names}
    # Where all are 0 they are the default.
    return {name: _digits(*each) for name, each in values.items() if np.any(each)}


def _changes_of(
    own: UserModel, motion: ContactMotion, seen: Seen, theory: ReferenceMotion, step: float
) -> Iterator[Change]:
    """Yield what the recipe has otherwise than the file, at steps of a length [s].

    Changes without which the others are not seen come first.
    """
    robot, scene = own.robot, theory.scene
    model, data = robot.model, own.begin()
    option, contact = model.opt, robot.contact(data)
    if seen.inside:
        yield _apart(model, seen)
    if gain := too_high_gain(own):
        yield _implicit(gain)
    if wrong := "; ".join(words for words, _ in start_misses(robot, data)):
        yield Change("start", wrong, start=True)
    ends_early = {
        "solver": option.solver != int(mujoco.mjtSolver.mjSOL_NEWTON),
        "iterations": option.iterations < 20,
        "ls_iterations": option.ls_iterations < 10,
        "tolerance": option.tolerance > 1e-8,
    }
    if solver := {name: _SOLVER[name] for name, ends in ends_early.items() if ends}:
        words = f"the solver ends early: {option.iterations} iterations, "
        words += f"{option.ls_iterations} of a line search, tolerance {option.tolerance:g}"
        yield Change("solver", words, option=solver)
    condim = 6 if scene.friction.rolling else 4 if scene.rolling == "rubber" else 3
    free = "slip" if contact.dim == 1 else "spin"
    lets = f"lets the shell {free}" if contact.dim < condim else "resists more than it should"
    if contact.dim != condim:
        words = f"condim {contact.dim} {lets}; {scene.rolling} rolling has {condim}"
        yield Change("condim", words, pair={"condim": str(condim)})
    if option.cone != int(mujoco.mjtCone.mjCONE_ELLIPTIC):
        words = "the cone of friction is a pyramid, which couples its directions"
        if seen.delivered is not None and seen.delivered < _DELIVERED:
            words += f" and delivers {seen.delivered:.0%} of the resistance to rolling"
        yield Change("cone", words, option={"cone": "elliptic"})
    yield from _friction(contact, theory, condim)
    if not gain and option.integrator != int(mujoco.mjtIntegrator.mjINT_RK4):
        yield Change("integrator", "the integrator is of first order", option={"integrator": "RK4"})
    if step < option.timestep:
        words = f"steps of {1e3 * option.timestep:g} ms are too long"
        words += f" for the gain of {_over_limit(gain)}" if gain else ""
        yield Change("timestep", words, option={"timestep": _digits(step)})
    depth = motion.report.depth[(motion.times < seen.until) & np.isfinite(motion.report.depth)]
    sinks = 1e3 * float(depth.mean()) if len(depth) else 0.0
    by = f": the sphere sinks {sinks:.2g} mm" if len(depth) else ""
    name, words = "softness", f"the contact is soft{by}, and bears no load at first"
    if sinks < 0:
        name, words = "margin", f"its margin holds the sphere {-sinks:.2g} mm above the plane"
    yield Change(name, words, pair={"solref": _digits(_SOFTEST, 1.0), "solimp": _digits(*_SOLIMP)})
    if option.noslip_iterations < 1:
        words = "friction is regularized, and creeps; slip is not solved for"
        yield Change("noslip", words, option={"noslip_iterations": "3"})


# The recipe's, in place of a solver that ends early.
_SOLVER = {"solver": "Newton", "iterations": "100", "ls_iterations": "50", "tolerance": "1e-10"}


def _overriding(model: Any, change: Change) -> Change:
    """Return a change that holds where the option's flag sets the numbers of every contact."""
    over = {f"o_{name}": change.pair[name] for name in _OVERRIDDEN if name in change.pair}
    if not over or not model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        return change
    words = f"{change.words}; the option's flag override sets this"
    return replace(change, words=words, option={**change.option, **over})


_OVERRIDDEN = ("margin", "solref", "solimp", "friction")


def _implicit(gain: Gain) -> Change:
    """Return the change to an integrator that is stable under a gain of an actuator."""
    words = f"{_over_limit(gain)}, implicitfast at any gain"
    return Change("gain", words, option={"integrator": "implicitfast"})


def _over_limit(gain: Gain) -> str:
    """Return an actuator's name, and its number beside the limit of an explicit step."""
    factors = f"{gain.kv:.3g}·{gain.gear:.3g}²·{gain.timestep:.3g}/{gain.inertia:.3g}"
    limit = f"{gain.integrator} is stable below {gain.most:.3g}"
    return f"{gain.name}: kv·gear²·dt/I = {factors} = {gain.number:.3g}; {limit}"


def _apart(model: Any, seen: Seen) -> Change:
    """Return the change that lets bodies inside the shell pass through one another."""
    more = len(seen.inside) - 1
    others = f", and {more} more pair{'s' if more > 1 else ''}" if more else ""
    words = next(_touching(model, seen)) + others
    bodies = {tuple(sorted(int(model.geom_bodyid[each]) for each in pair)) for pair in seen.inside}
    # A body without a name is given one in the mended file.
    names = ((body_name(model, i), body_name(model, j)) for i, j in sorted(bodies))
    return Change("contacts", words, exclude=tuple(names))


def _touching(model: Any, seen: Seen) -> Iterator[str]:
    """Yield which geoms touch inside the shell, and how often, in words; the most first."""
    for pair, part in seen.inside.most_common(_MOST_PAIRS):
        a, b = (geom_name(model, each) for each in pair)
        yield f"{a} touches {b} in {part:.0%} of the steps"


def _friction(contact: Any, theory: ReferenceMotion, condim: int) -> Iterator[Change]:
    """Yield the change to as much friction as any motion needs."""
    radius, loads = theory.scene.ball.radius, theory.loads
    normal = loads.contact_force[:, 2]
    needed = float((np.linalg.norm(loads.contact_force[:, :2], axis=1) / normal).max())
    twist = float((np.abs(loads.spin_torque) / normal).max())
    slide, _, spin, roll, _ = contact.friction
    # Classical rolling has no torque about the normal, which condim 6 has not without.
    most = (_SLIDE, _SLIDE * radius if theory.scene.rolling == "rubber" else mujoco.mjMINMU)
    words = [f"sliding friction {slide:.3g}, of which the motion needs {needed:.2g}"]
    if condim > 3 and theory.scene.rolling == "rubber":
        words.append(f"torsional friction {spin:.3g} m, of which it needs {twist:.2g}")
    if slide < most[0] or (condim > 3 and spin != most[1]):
        values = _digits(most[0], most[0], most[1], roll, roll)
        yield Change("friction", "; ".join(words), pair={"friction": values})


_Needed = tuple[Change, float]  # with the error without it


@dataclass(frozen=True)
class Checked:
    """A model as it is beside its reference, and mended.

    asked: the duration [s] and the accuracy that were asked for; short: why less was compared, in
    words; path (n, 3): contact point and height as it is [m]; error: its path error; since: when it
    passes the accuracy [s]; fails: why it is not right whatever its error, in words; judged:
    whether anything moves enough; tried: how long each change was tried [s]; others: the error by
    the rolling model that is farther; motion, seen: as it is, at every step; needed: the fewest
    changes that help, each with the error without it, the largest first; spared: the others;
    unlikely: what both motions have; edit, text: the user's file and the mended one; mended (n, 3):
    its path.
    """

    theory: ReferenceMotion
    asked: tuple[float, float]
    short: str | None
    path: Array
    error: float
    since: float | None
    fails: str | None
    judged: bool
    tried: float
    others: Mapping[str, float | None]
    motion: ContactMotion
    seen: Seen
    needed: Sequence[_Needed]
    spared: Sequence[Change]
    unlikely: Sequence[str]
    edit: Editable
    text: str
    mended: Array
    mended_error: float

    @property
    def agrees(self) -> bool:
        """Whether it rolled all the time asked for, in contact, as the equations do, and moved."""
        return self.fails is None and self.short is None and self.error <= self.asked[1]


def _away(path: Array, theory: ReferenceMotion) -> Array:
    """Return the distances (k,) of a path (k, 3) from the reference's, over its unit of length.

    A height above the plane counts as well.
    """
    off = path[:, :2] - theory.contact_point[: len(path)]
    away: Array = np.hypot(np.linalg.norm(off, axis=1), np.maximum(path[:, 2], 0.0))
    return away / theory.path_scale


def _error(path: Array, theory: ReferenceMotion) -> float:
    """Return the path error; inf where the path broke off."""
    return float(np.nan_to_num(_away(path, theory), nan=np.inf).max())


@mujoco_silent()  # a state that diverges is said in words
def check_model(
    own: UserModel, rolling: Rolling | None, duration: float, accuracy: float, show: Show
) -> Checked:
    """Check a user's model against ideal rolling over a duration [s].

    accuracy: the path error to reach; show: called with the part that is done, and what is next.
    Less is compared where all would take too long. Raises InputError where the reference has no
    motion.
    """
    robot, data = own.robot, own.begin()
    default = rolling_of(robot.contact(data))
    if robot.model.opt.timestep < _SHORTEST:
        line = f"timestep must be at least {_SHORTEST:g} s for a check"
        raise InputError(f"{robot.path}: {line}, not {robot.model.opt.timestep:g} s")
    # From one state that is looked at to the next.
    steps = max(1, round(_LOOK / robot.model.opt.timestep))
    every = max(1, round(_INTERVAL / (steps * robot.model.opt.timestep)))
    interval = every * steps * robot.model.opt.timestep
    times = interval * np.arange(max(2, round(duration / interval) + 1))
    duration = float(times[-1])
    scene = own.scene(default, duration)
    motion, seen = observed(own, scene, accuracy, steps, lambda part: show(0.2 * part, "as it is"))
    if not seen.fails:  # as far as it was stepped
        times = times[: max(2, 1 + (len(seen.path) - 1) // every)]
    path = np.full((len(times), 3), np.nan)
    stepped = seen.path[::every][: len(times)]
    path[: len(stepped)] = stepped
    theories = _theories(own, rolling, default, path, times, accuracy, show)
    errors = {name: _error(path[: len(each.times)], each) for name, each in theories.items()}
    nearest = min(errors, key=lambda name: errors[name] / (1.0 if name == default else _NEARER))
    theory, as_it_is = theories[nearest], errors[nearest]
    times, path = theory.times, path[: len(theory.times)]
    moved_by = max(_reach(path), theory.path_length)
    judged = seen.fails is not None or moved_by >= _LEAST_PATH * own.radius
    fails = seen.fails or _standing(path, theory, judged)
    if seen.fails:
        path[times >= seen.until] = np.nan
    since = np.flatnonzero(~(_away(path, theory) <= accuracy))
    normal, gap = robot.above_plane(data)  # by which it is set down, to roll from its start on
    moves = Moves(-gap * normal, -robot.slip(data), robot.keyframe(own.key))
    bodies = {int(robot.model.geom_bodyid[each]) for pair in seen.inside for each in pair}
    edit = editable(robot, moves, _pair_of(robot.contact(data)), bodies)

    def with_changes(changes: Iterable[Change]) -> UserModel:
        return _by_text(own, edit.changed(changes))

    def changes_at(step: float) -> list[Change]:
        found = _changes_of(own, motion, seen, theory, step)
        changes = [_overriding(robot.model, each) for each in found]
        return _carrying(changes, with_changes(changes), theory)

    # A contact or a gain that is wrong may stop the robot before a wall, or throw it at one: it is
    # mended to see what it meets.
    first = [_apart(robot.model, seen)] if seen.inside else []
    first += [_implicit(gain)] if (gain := too_high_gain(own)) else []
    met = [each for each in seen.met if each[0] <= times[-1] and not first]
    if first:
        with_changes(first).path(times, met)
    full, began = changes_at(robot.model.opt.timestep), time.process_time()
    by_recipe = list[Met]()
    at_all_times = with_changes(full).path(times, by_recipe)
    cost = measured_time(time.process_time() - began) / len(times)
    meetings, soon = sorted([*met, *by_recipe]), _LEAST_SAMPLES * interval
    # A state that diverges at once may touch anything; that it diverges is the verdict then.
    if meetings and not (seen.diverged and meetings[0][0] < soon):
        at, words = meetings[0]
        line = f"{words} at t = {at:.3g} s"
        if at < soon:
            started = "".join(f"; {words}" for words, _ in start_misses(robot, data))
            raise InputError(f"{robot.path}: {line}, too soon for a comparison{started}")
        checked = check_model(own, rolling, at - 2 * interval, accuracy, show)
        line = f"ends early: {line}, of {duration:.3g} s"
        return replace(checked, asked=(duration, accuracy), short=checked.short or line)
    least = 2 + int(1.2 * since[0]) if len(since) else 2
    most = len(full) + 4  # runs, of which those with all changes cost the most
    tried = times[: max(least, int(_PATIENCE / (most * cost)))]

    def named(changes: Iterable[Change]) -> frozenset[str]:
        return frozenset(str(each) for each in changes)

    paths = {named(full): at_all_times[: len(tried)]}

    def path_of(changes: Sequence[Change]) -> Array:
        names = named(changes)
        if names not in paths:
            done = len(paths) / most
            show(min(0.95, 0.4 + 0.6 * done), "what each choice is worth")
            paths[names] = with_changes(changes).path(tried)
        return paths[names]

    def error_of(changes: Sequence[Change]) -> float:
        return _error(path_of(changes), theory)

    needed: list[_Needed] = []
    if judged and (fails or as_it_is > accuracy):
        full = _enough(changes_at, robot.model.opt.timestep, accuracy, error_of)
        needed = _fewest(full, max(accuracy, _LOOSE * error_of(full)), error_of)
    made = [change for change, _ in needed]
    mended = path_of(made) if len(tried) == len(times) else with_changes(made).path(times)
    return Checked(
        theory,
        asked=(duration, accuracy),
        short=_why_short(theory, duration),
        path=path,
        error=as_it_is,
        since=float(times[since[0]]) if len(since) else None,
        fails=fails,
        judged=judged,
        tried=float(tried[-1]),
        others={name: known(error) for name, error in errors.items() if name != nearest},
        motion=motion,
        seen=seen,
        needed=needed,
        spared=[each for each in full if each.name not in {one.name for one in made}],
        unlikely=[*_unlikely(theory.scene, bool(np.allclose(robot.plane_axes(data), np.eye(3))))],
        edit=edit,
        text=edit.changed(made),
        mended=mended,
        mended_error=_error(mended, theory),
    )


def _by_text(own: UserModel, text: str) -> UserModel:
    """Return a model of another text, with the same controls and start."""
    return replace(own, robot=replace(own.robot, model=compiled(text)))


def _reach(path: Array) -> float:
    """Return how far a path gets from its start [m]."""
    return float(np.nanmax(np.linalg.norm(path[:, :2], axis=1)))


def _standing(path: Array, theory: ReferenceMotion, judged: bool) -> str | None:
    """Return that a path stands still where the equations roll, or that neither moves, in words."""
    reach, end = _reach(path), theory.times[-1]
    words = None
    if not judged:
        words = "no verdict: neither it nor the equations move by a tenth of the radius in "
        words += f"{end:.3g} s; see --control and --keyframe"
    elif _keeps_still(path, theory):
        words = f"it stands still: it gets {reach:.2g} m away in {end:.3g} s, where the equations "
        words += f"roll {theory.path_length:.3g} m"
    return words


def _keeps_still(path: Array, theory: ReferenceMotion) -> bool:
    return _reach(path) < _STILL * _reach(theory.contact_point)


def _why_short(theory: ReferenceMotion, duration: float) -> str | None:
    """Return why less than the duration was compared, in words."""
    end = float(theory.times[-1])
    if theory.ended:
        return f"limit: {theory.ended}, of {duration:.3g} s"
    if end < duration - _INTERVAL / 2:
        return f"only {end:.3g} s of {duration:.3g} s are checked: all would take too long"
    return None


def beside(own: UserModel, checked: Checked) -> list[Motion]:
    """Return the motions of a file as it is, of the mended one, and of the equations.

    They are at the same times, as long as each lasts.
    """
    theory, found = checked.theory, [checked.motion]
    if checked.needed:
        mended = _by_text(own, checked.text)
        scene, error = checked.motion.scene, checked.mended_error
        every = round(theory.times[1] / mended.robot.model.opt.timestep)
        found.append(observed(mended, scene, error, every, name="mended")[0])
    shown = []
    for each in found:
        # A time of the model's own is a sum of steps.
        times = theory.times[theory.times < each.times[-1] + each.report.timestep / 2]
        if len(times) < 2:  # it diverged at once, and a view has nothing to show
            continue
        rows = np.abs(each.times - times[:, None]).argmin(axis=1)
        arrays = {place: array[rows] for place, array in arrays_of(each)}
        shown.append(with_arrays(each, arrays | {("times",): times}))
    return [*shown, theory]


_LEAST_SAMPLES = 5  # of a comparison that ends early
_LOOSE = 1.1  # times the least error, where the accuracy is out of reach
_Measure = Callable[[Sequence[Change]], float]


def _theories(
    own: UserModel,
    rolling: Rolling | None,
    default: Rolling,
    path: Array,
    times: Array,
    accuracy: float,
    show: Show,
) -> dict[Rolling, ReferenceMotion]:
    """Return the motions of the rolling models, that of the contact's condim first.

    A path that stands still does not tell which is meant, and is held to the first. Raises
    InputError where there is no motion.
    """
    found: dict[Rolling, ReferenceMotion] = {}
    refused = InputError("")
    for each in [rolling] if rolling else sorted(get_args(Rolling), key=lambda it: it != default):
        scene = own.scene(each, float(times[-1]))
        try:
            with warnings.catch_warnings(action="ignore", category=SceneWarning):
                found[each] = motion = _in_time(scene, times, accuracy, show)
        except InputError as error:
            perhaps = "".join(f"; perhaps {each}" for each in _unlikely(scene, level=True))
            refused = InputError(f"{own.robot.path}: {error}{perhaps}")
            if isinstance(error.__cause__, _SlowError):
                break  # the other model would take as long
            continue
        if len(motion.times) < len(times) and not motion.ended:
            break
        if _keeps_still(path, motion):
            break
    if not found:
        raise refused
    return found


class _SlowError(Exception):
    """Raised where equations would take too long, with the part of the motion that is known."""


def _in_time(scene: Scene, times: Array, accuracy: float, show: Show) -> ReferenceMotion:
    """Return the motion by the equations, or as much of it as does not take too long."""
    began: list[float] = []
    rtol = max(_OF_ACCURACY * accuracy, LEAST_RTOL)

    def look(part: float) -> None:
        show(0.2 + 0.2 * part, "equations")
        began.append(time.process_time())
        if began[-1] - began[0] > _PATIENCE / 2 and part < 0.5:
            raise _SlowError(part)

    try:
        return integrate(scene, times, rtol, progress=look)
    except _SlowError as slow:
        known: float = slow.args[0]
        count = int(0.8 * known * len(times))
        if count < 2:
            words = f"its equations take {_PATIENCE / 2:g} s of processor time for "
            words += f"{known * times[-1]:.2g} s of the motion; a joint friction or a gain on a "
            raise InputError(f"{words}light body, or very many bodies, may be the cause") from slow
    return integrate(scene, times[:count], rtol)


def _enough(
    changes_at: Callable[[float], list[Change]], step: float, accuracy: float, error_of: _Measure
) -> list[Change]:
    """Return all changes, with the longest step that reaches the accuracy, or the best one."""
    while 2 * step > _SOFTEST:  # steps that would soften the contact
        step /= 2
    found = [changes_at(step)]
    helps = True
    while error_of(found[-1]) > accuracy and step / 2 >= _LEAST_STEP and helps:
        step /= 2
        found.append(changes_at(step))
        before, after = (error_of(each) for each in found[-2:])
        helps = after < before / 2 or not np.isfinite(after)
    return min(found, key=lambda each: max(error_of(each), accuracy))


def _carrying(changes: list[Change], own: UserModel, theory: ReferenceMotion) -> list[Change]:
    """Return the changes with the margin at which the contact carries the load from the start.

    A sphere that just touches has no normal force at first, and slips: 1e-3 of the path and more.
    own: the model with the changes.
    """
    robot, data = own.robot, own.begin()
    model, load = robot.model, float(theory.loads.contact_force[0, 2])
    sphere = np.flatnonzero((model.pair_geom1 == robot.sphere) | (model.pair_geom2 == robot.sphere))

    def excess(margin: float) -> float:
        model.pair_margin[sphere] = model.opt.o_margin = margin
        mujoco.mj_forward(model, data)
        return float(sum(wrench[0] for _, wrench in wrenches(robot, data))) - load

    guess = theory.scene.gravity * (1 - _SOLIMP[1]) * float(model.pair_solref[sphere[0], 0]) ** 2
    with warnings.catch_warnings(action="ignore"):
        found = root_scalar(excess, x0=guess, x1=1.1 * guess)
    if not (found.converged and 0 < found.root < _STANDS * theory.scene.ball.radius):
        return changes
    held = {"margin": _digits(found.root)}
    return [
        replace(each, pair={**each.pair, **held}) if "solref" in each.pair else each
        for each in changes
    ]


def _fewest(changes: Sequence[Change], limit: float, error_of: _Measure) -> list[_Needed]:
    """Return the fewest changes by which the error keeps to the limit, with the error without each.

    The one without which it is largest is the first. The finer points, which are the last, are left
    out before the others.
    """

    def without(change: Change, among: Sequence[Change]) -> float:
        return error_of([each for each in among if each is not change])

    needed, before = list(changes), None
    while needed != before:  # as one may be needed only as long as another is there
        before = needed
        for each in changes[::-1]:
            if each in needed and without(each, needed) <= limit:
                needed = [other for other in needed if other is not each]
    return sorted(((each, without(each, needed)) for each in needed), key=lambda it: -it[1])


_DELIVERED = 0.95  # of the declared resistance: less is worth a word
_USUAL = 0.02  # relative: a gravity that is nearer to the Earth's is usual
_RESISTS = 0.1  # of the radius: less rolling friction is usual
_SMALL_GEAR = 0.01


def _unlikely(scene: Scene, level: bool) -> Iterator[str]:
    """Yield what both motions have, and the author may not mean: what acts on all of it first.

    level: whether the plane is level in the file, where a tilted gravity is not meant.
    """
    if abs(scene.gravity / GRAVITY - 1) > _USUAL:
        yield f"gravity: it is {scene.gravity:g} m/s², where the Earth's is {GRAVITY:g}"
    if level and scene.gravity_direction != DOWN:
        tilt = np.degrees(np.arccos(-scene.gravity_direction[2]))
        yield f"gravity: it is tilted by {tilt:.3g} deg, and the plane is level"
    roll, radius = scene.friction.rolling, scene.ball.radius
    if roll > _RESISTS * radius:
        part = f"{roll / radius:.0%} of the radius"
        yield f"resistance: a rolling friction of {roll:g} m is declared, {part}"
    inside = {link.name: link for link in scene.ball.tree[1:]}
    levers = sum(link.mass * float(np.linalg.norm(link.centre)) for link in inside.values())
    times = np.linspace(0.0, scene.duration, 101)
    for each in scene.actuators:
        law, command = each.law, as_drive(each.command, scene.duration)
        # A servo's torque falls as it follows; a motor's does not.
        lasts = not (law.per_angle or law.per_rate)
        torque = float(np.abs(law.torque(command.rate(times), 0.0, 0.0)).max())
        for name, gear in each.gears:
            slides, by = inside[name].slides, f"by a gear of {gear:g}"
            holds = scene.gravity * (inside[name].mass if slides else levers)
            if lasts and torque * abs(gear) > holds > 0:
                load = f"{torque * abs(gear):.3g} {'N' if slides else 'N m'} on {name}"
                yield f"gear: {each.name} puts {load} {by}, against weights of {holds:.3g}"
            elif 0 < abs(gear) <= _SMALL_GEAR:
                yield f"gear: {each.name} moves {name} {by} alone"


def moved(own: UserModel) -> tuple[UserModel, list[str]]:
    """Return a model that moves: itself, or with controls or a push; and words on these."""
    if not _stands(own):
        return own, []
    model, words = own.robot.model, "nothing moves it; it is checked with {}; see --control"
    gravity = float(np.linalg.norm(model.opt.gravity))
    torque = _TORQUE * float(model.body_subtreemass[0]) * gravity * own.radius
    controls: dict[str, Drive] = {}
    for name, gears in gears_of(model).items():
        i, joints = own.actuators[name], [*gears]
        scale = float(model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0])
        _, angle, rate = model.actuator_biasprm[i, :3]
        value = _ANGLE if angle else _RATE if rate else torque / (abs(scale) or 1.0)
        if model.actuator_ctrllimited[i]:
            low, high = (float(end) for end in model.actuator_ctrlrange[i])
            value = min(value, high / 4) if high > 0 else max(-value, low / 4)
        slides = np.any(model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_SLIDE))
        if slides or (np.any(model.jnt_limited[joints]) and not angle):
            value = 0.0  # it would soon reach its range
        controls[name] = Constant(value)
    if not any(each.rate(0.0) for each in controls.values()):
        push = float(np.sqrt(gravity * own.radius)) / 2
        return replace(own, push=push), [words.format(f"a push, rolling at {push:.2g} m/s")]
    given = ", ".join(f"{name}={value.rate(0.0):.3g}" for name, value in controls.items())
    return replace(own, controls=controls), [words.format(given)]


def _stands(own: UserModel) -> bool:
    """Return whether a model without controls, started at rest, stays where it is."""
    data, step = own.begin(), own.robot.model.opt.timestep
    if own.controls or np.any(data.ctrl) or np.any(data.qvel):
        return False
    path = own.path(step * round(1 + 0.1 / step) * np.arange(20))
    return bool(np.nanmax(np.abs(path[:, :2])) < _STANDS * own.radius)


COLUMNS = (
    Column("change", "change", words=True),
    Column("path error\nwithout it", "without"),
    Column("what it mends", "words", words=True),
)


def study_of(own: UserModel, checked: Checked, words: Sequence[str]) -> Study:
    """Return the table, record, picture and words of a checked model; words: known before."""
    theory, file, accuracy = checked.theory, own.robot.path, checked.asked[1]
    rows = [_line(f"+ {each.name}", each.words, without) for each, without in checked.needed]
    rows += [_line(f"({each.name})", each.words) for each in checked.spared]
    lines = [*words, *_verdict(checked), *_symptoms(own, checked)]
    # A motion that breaks off, or in which nothing moves, says nothing by its error.
    error = known(checked.error) if checked.judged and not checked.seen.fails else None
    if checked.needed:
        reached = "" if checked.mended_error <= accuracy else f", more than {accuracy:g}"
        lines.append(f"mended: path error {scientific(known(checked.mended_error))}{reached}")
    return Study(
        file.stem, None, ["check"], rows,
        record={
            "file": str(file),
            "agrees": checked.agrees,
            "rolling": theory.scene.rolling,
            "duration": float(theory.times[-1]),
            "accuracy": accuracy,
            "path_error": error,
            "since": checked.since,
            "fails": checked.fails,
            "ends_early": checked.short,
            "other_rolling": checked.others,
            "causes": causes_of(checked),
            "lines": lines,
            "changes": rows,
            "mended_error": known(checked.mended_error),
        },
        shown=(
            f"[bold]{escape(file.name)}[/]",
            *map(escape, lines),
            *([table_of(COLUMNS, rows)] if checked.needed else []),
        ),
        picture=_check_picture(file.name, checked),
    )  # fmt: skip


def _line(change: str, words: str, without: float | None = None) -> dict[str, Any]:
    return {"change": change, "without": known(without), "words": words}


def causes_of(checked: Checked) -> list[str]:
    """Return the causes of an error, the first one first; of a model that is right what is unusual.

    A gear is in both motions, and the first cause only where nothing else is or nothing rolls.
    """
    causes = [f"{change.name}: {change.words}{_worth(error)}" for change, error in checked.needed]
    causes += [checked.short] if checked.short and checked.theory.ended else []
    theory = checked.theory
    rolls = theory.path_length >= theory.scene.ball.radius
    helped = rolls and checked.needed and checked.mended_error <= checked.asked[1]
    for line in reversed(checked.unlikely):
        causes.insert(len(causes) if line.startswith("gear") and helped else 0, line)
    if not causes and checked.judged and not checked.agrees and not checked.short:
        perhaps = "a sensitive motion leaves any path in time, so try a shorter --duration"
        if checked.seen.diverged:
            perhaps = "a stiff joint or a high gain may need a shorter timestep"
        causes.append(f"unknown: no choice of the recipe helps; {perhaps}")
    return causes


def _worth(error: float) -> str:
    if not np.isfinite(error):
        return " (without this change it diverges)"
    return f" (path error {scientific(error)} without this change)"


def _verdict(checked: Checked) -> Iterator[str]:
    """Yield whether the model agrees, or how it fails or is off, and the first cause."""
    theory, (duration, accuracy) = checked.theory, checked.asked
    length, radius, end = theory.path_length, theory.scene.ball.radius, theory.times[-1]
    unit = f"a path of {length:.3g} m" if length >= radius else f"the radius of {radius:.3g} m"
    error = f"path error {scientific(known(checked.error))}, over {unit}, in {end:.3g} s"
    asked = f"the accuracy asked for is {accuracy:g}"
    if checked.fails:
        verdict = checked.fails
    elif checked.error > accuracy:
        verdict = f"does not agree: {error}; {asked}, exceeded from t = {checked.since:.2g} s on"
    elif checked.short:
        verdict = f"no verdict on {duration:.3g} s: {error}; {asked}"
    else:
        verdict = f"agrees: {error}; {asked}"
    yield f"as it is: {verdict}"
    if checked.short:
        yield checked.short
    if checked.judged:
        others = "".join(f" ({name}: {scientific(each)})" for name, each in checked.others.items())
        yield f"rolling: {theory.scene.rolling}{others}"
    for cause in causes_of(checked)[:1]:
        yield f"{'unusual' if checked.agrees else 'cause'}: {cause}"
    if checked.needed and checked.tried < end:
        yield f"causes are sought in the first {checked.tried:.3g} s"


def _symptoms(own: UserModel, checked: Checked) -> Iterator[str]:
    """Yield what contacts, joints and servos do that the path alone does not show.

    Nothing is measured after the time at which the rolling ends.
    """
    seen, theory, motion = checked.seen, checked.theory, checked.motion
    report, radius, scene = motion.report, theory.scene.ball.radius, theory.scene
    rolls = motion.times <= min(seen.until, theory.times[-1])
    if (lost := np.isnan(report.depth[rolls])).any() and not seen.fails:
        yield f"contact: lost for {lost.mean():.2%} of the time"
    points = motion.contact_point[rolls]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length > _LEAST_PATH * radius:
        rolled = length / motion.times[rolls][-1]
        yield f"slip: {scientific(report.slip[rolls].mean() / rolled)} of its path"
        if scene.rolling == "rubber":
            spin = radius * np.abs(report.spin[rolls]).mean() / rolled
            yield f"spin: {scientific(spin)} of its path"
    for each in scene.actuators:
        commands = as_drive(each.command, scene.duration).rate(theory.times)
        clipped = np.clip(commands, *each.within)
        if (beyond := clipped != commands).any():
            given, taken = (values[np.argmax(beyond)] for values in (commands, clipped))
            yield f"control: {each.name} takes {given:.3g} for {taken:.3g}, by its ctrlrange"
    if seen.delivered is not None and checked.judged and not seen.fails:
        declared = f"{scene.friction.rolling:g} m is declared, which is in the reference"
        part = f"the contact delivers {seen.delivered:.0%} of it"
        yield f"rolling resistance: {declared}; {part}"
    for line in _touching(own.robot.model, seen):
        yield f"inside: {line}"
    for name, time_reached in seen.limits.items():
        if time_reached <= seen.until:
            yield f"limit: {name} reaches its range at t = {time_reached:.3g} s"
    for name, lag in seen.lag.items():
        if lag > _LAGS and not seen.fails:
            yield f"servo: {name} misses its command by {lag:.0%} (root mean square)"


def difference(checked: Checked) -> list[str]:
    """Return the lines in which the mended file differs from the user's, as a diff has them."""
    before, after = (text.splitlines() for text in (checked.edit.source, checked.text))
    lines = difflib.unified_diff(before, after, "as it is", "mended", n=0, lineterm="")
    return [*lines][:_MOST_LINES]


def _check_picture(name: str, checked: Checked) -> Figure:
    """Draw the paths, and the errors over time, as it is and mended."""
    theory = checked.theory
    figure = Figure(figsize=(11.0, 5.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    wide = {"color": theory.engine.colour, "lw": 5, "alpha": 0.6}
    left.plot(*theory.contact_point.T, **wide, label="equations")
    found = []
    own, dashes, _ = PRESET_LOOKS["mended"]
    as_it_is = ("as it is", checked.path, LABEL.colour, "-")
    mended = ("mended", checked.mended, own, (0, dashes))
    for label, path, colour, dash in (as_it_is, mended) if checked.needed else (as_it_is,):
        # Its end is marked, as a path may end within another.
        last = np.flatnonzero(np.isfinite(path[:, 0]))[-1:].tolist()
        left.plot(*path[:, :2].T, ls=dash, marker="o", markevery=last, color=colour, label=label)
        away = _away(path, theory)
        right.semilogy(theory.times[1:], away[1:], ls=dash, color=colour, label=label)
        found.append(f"{label} off by {scientific(known(away.max()))}")
    if checked.fails:
        found[0] = f"as it is, {checked.fails}"
    title(figure, f"{name}: {'; '.join(found)}")
    left.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal", title="contact point")
    left.set_adjustable("datalim")
    if not np.any(theory.contact_point) or not np.nansum(np.abs(path)):
        right.set_yscale("linear")
    right.axhline(checked.asked[1], color="gray", linestyle=":", label="asked for")
    right.set(xlabel="t [s]", title="path error over the path's length or the radius")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    return figure


_MOST_PAIRS, _LAGS = 5, 0.1
_MOST_LINES = 60  # of a diff
