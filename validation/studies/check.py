"""Check a user's own model: does it roll right as it is, and if not, which line of it is wrong?

Its model is stepped by plain `mj_step`, as the file says, beside ideal rolling of the same tree.
Then the choices of the recipe are made in it: the fewest that reach the accuracy are found by
leaving out one after the other, and are put in the order of their effect. The first is the cause.
"""

import difflib
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
from robotball.drives import Constant, Drive, as_drive
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.settings import BY_ERROR, CONSTANT, recipe
from robotball.engines.mujoco.user_model import Seen, UserModel, observed
from robotball.equations import Rolling
from robotball.errors import SceneWarning
from robotball.files.mended_file import Change, Editable, compiled, editable
from robotball.files.robot_file import RobotFile, gears_of, rolling_of
from robotball.film.lines import PRESET_LOOKS
from robotball.motion import ContactMotion, FaultKind, Motion
from robotball.rotations import Array
from robotball.scene import GRAVITY
from validation.output import Show, known, scientific, title
from validation.study import Column, Study, table_of

_INTERVAL = 0.01  # s between the points that are compared, or the model's own step
_LEAST_STEP = 1e-4  # s, the shortest that is tried
_STANDS = 1e-3  # of the radius: a robot that rolls less in all is moved
# Controls of a robot that would not move: rad, rad/s, and of the weight at the radius.
_ANGLE, _RATE, _TORQUE = 0.3, 2.0, 0.03
_NEARER = 0.5  # times the other's error: a rolling model so near is the one that the file has


# The recipe's: friction beyond any demand, and a contact as hard as MuJoCo's own steps take, whose
# time constant [s] is two steps at least.
_SLIDE, _SOFTEST = CONSTANT["sliding_friction"], BY_ERROR[1]
_SOLIMP: Any = recipe("mended", 1e-3).solimp


def _digits(*values: float) -> str:
    return " ".join(f"{each:.9g}" for each in values)


def _pair_of(contact: Any) -> dict[str, str]:
    """Return the attributes of a pair that makes this contact."""
    values = {
        "condim": [contact.dim],
        "friction": contact.friction,
        "solref": contact.solref,
        "solreffriction": contact.solreffriction,
        "solimp": contact.solimp,
        "margin": [contact.includemargin],
    }
    # Where all are 0 they are the default.
    return {name: _digits(*each) for name, each in values.items() if np.any(each)}


def _changes_of(
    own: UserModel, motion: ContactMotion, seen: Seen, theory: Motion, step: float
) -> list[Change]:
    """Return what the recipe has otherwise than the file, at steps of a length [s].

    Changes without which the others are not seen come first.
    """
    robot, scene = own.robot, theory.scene
    model, data = robot.model, own.begin()
    option, contact = model.opt, robot.contact(data)
    found = []
    if seen.inside:
        found.append(_apart(model, seen))
    gap = robot.above_plane(data)[1]
    if abs(gap) > _STANDS * scene.ball.radius / 100:
        way = "above" if gap > 0 else "in"
        found.append(
            Change("start", f"it starts {1e3 * abs(gap):.3g} mm {way} the plane", start=True)
        )
    resists = scene.friction.rolling
    condim = 6 if resists else 4 if scene.rolling == "rubber" else 3
    if contact.dim != condim:
        lets = (
            "lets the shell spin" if contact.dim < condim else "resists what this rolling does not"
        )
        words = f"condim {contact.dim} {lets}; {scene.rolling} rolling has {condim}"
        found.append(Change("condim", words, pair={"condim": str(condim)}))
    if option.cone != int(mujoco.mjtCone.mjCONE_ELLIPTIC):
        words = "the cone of friction is a pyramid, which couples its directions"
        if seen.delivered is not None and seen.delivered < _DELIVERED:
            words += f" and delivers {seen.delivered:.0%} of the resistance to rolling"
        found.append(Change("cone", words, option={"cone": "elliptic"}))
    found += _friction(contact, theory, condim)
    if option.integrator != int(mujoco.mjtIntegrator.mjINT_RK4):
        words = "the integrator is of first order"
        found.append(Change("integrator", words, option={"integrator": "RK4"}))
    if step < option.timestep:
        words = f"steps of {1e3 * option.timestep:g} ms are too long"
        found.append(Change("timestep", words, option={"timestep": _digits(step)}))
    depth = f"{1e3 * np.nanmean(motion.report.depth):.2g} mm"
    words = f"the contact is soft: the sphere sinks {depth}, and bears no load at first"
    hard = {"solref": _digits(_SOFTEST, 1.0), "solimp": _digits(*_SOLIMP)}
    found.append(Change("softness", words, pair=hard))
    if option.noslip_iterations < 1:
        words = "friction is regularized, and creeps; slip is not solved for"
        found.append(Change("noslip", words, option={"noslip_iterations": "3"}))
    solver = {}
    if option.solver != int(mujoco.mjtSolver.mjSOL_NEWTON):
        solver["solver"] = "Newton"
    if option.iterations < 20:
        solver["iterations"] = "100"
    if option.tolerance > 1e-8:
        solver["tolerance"] = "1e-10"
    if solver:
        words = (
            f"the solver ends early: {option.iterations} iterations, tolerance {option.tolerance:g}"
        )
        found.append(Change("solver", words, option=solver))
    return found


def _apart(model: Any, seen: Seen) -> Change:
    """Return the change that lets bodies inside the shell pass through one another."""
    (a, b), part = seen.inside.most_common(1)[0]
    others = f", and {len(seen.inside) - 1} more pairs" if len(seen.inside) > 1 else ""
    words = (
        f"{_geom_name(model, a)} touches {_geom_name(model, b)} in {part:.0%} of the steps{others}"
    )
    bodies = {tuple(sorted(int(model.geom_bodyid[each]) for each in pair)) for pair in seen.inside}
    pairs = tuple((_body_name(model, i), _body_name(model, j)) for i, j in sorted(bodies))
    return Change("contacts", words, exclude=pairs)


def _body_name(model: Any, body: int) -> str:
    """Return a body's name, or the one that the mended file gives it."""
    return model.body(body).name or f"body{body}"


def _geom_name(model: Any, geom: int) -> str:
    return model.geom(geom).name or f"a geom of {_body_name(model, model.geom_bodyid[geom])}"


def _friction(contact: Any, theory: Motion, condim: int) -> Iterator[Change]:
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


@dataclass(frozen=True)
class Checked:
    """A model as it is beside its reference, and mended.

    ended: the line of a joint whose range ends the reference early; path (n, 2): as it is [m];
    error: its; since: when it passes the accuracy [s]; others: the error by the rolling model that
    is farther; motion, seen: as it is, at every step; needed: changes by their effect, each with
    the error after it and the error where it alone is undone; spared: the others, with the error
    after each; edit, text: the user's file and the mended one; mended (n, 2): its path [m].
    """

    theory: Motion
    ended: str | None
    path: Array
    error: float
    since: float | None
    others: Mapping[str, float]
    motion: ContactMotion
    seen: Seen
    needed: Sequence[tuple[Change, float, float]]
    spared: Sequence[tuple[Change, float]]
    edit: Editable
    text: str
    mended: Array
    mended_error: float


def _away(path: Array, theory: Motion) -> Array:
    """Return the distances (n,) of a path (n, 2) at the reference's times, over its length."""
    theirs = theory.contact_point
    away: Array = np.linalg.norm(path[: len(theirs)] - theirs, axis=1) / theory.path_scale
    return away


def _error(path: Array, theory: Motion) -> float:
    """Return the path error; inf where the path broke off."""
    return float(np.nan_to_num(_away(path, theory), nan=np.inf).max())


def check_model(
    own: UserModel, rolling: Rolling | None, duration: float, accuracy: float, show: Show
) -> Checked:
    """Check a user's model against ideal rolling over a duration [s].

    accuracy: the path error to reach; show: called with the part that is done, and what is next.
    Raises InputError where the reference has no motion.
    """
    robot, data = own.robot, own.begin()
    every = max(1, round(_INTERVAL / robot.model.opt.timestep))
    interval = every * robot.model.opt.timestep
    times = interval * np.arange(max(2, round(duration / interval) + 1))
    show(0.0, "equations")
    theories = _theories(own, rolling, times)
    show(0.2, "as it is")
    path = own.path(max((each.times for each, _ in theories.values()), key=len))
    errors = {name: _error(path, each) for name, (each, _) in theories.items()}
    default = next(iter(errors))
    nearest = min(errors, key=lambda name: errors[name] / (_NEARER if name != default else 1.0))
    theory, ended = theories[nearest]
    times, path = theory.times, path[: len(theory.times)]
    scene = own.scene(theory.scene.rolling, float(times[-1]))
    motion, seen = observed(own, scene, accuracy)
    _check_no_drive_from_outside(robot, seen)
    since = np.flatnonzero(~(_away(path, theory) <= accuracy))
    normal, gap = robot.above_plane(data)
    edit = editable(
        robot, -gap * normal, _pair_of(robot.contact(data)), _touching(robot.model, seen)
    )
    measured: dict[frozenset[str], float] = {}

    def with_changes(changes: Iterable[Change]) -> UserModel:
        return replace(own, robot=replace(robot, model=compiled(edit.changed(changes))))

    def mended(changes: Iterable[Change]) -> Array:
        return with_changes(changes).path(times)

    def changes_at(step: float) -> list[Change]:
        changes = _changes_of(own, motion, seen, theory, step)
        return _carrying(changes, with_changes(changes), theory)

    def error_of(changes: Sequence[Change]) -> float:
        names = frozenset(str(each) for each in changes)
        if names not in measured:
            show(min(0.9, 0.3 + len(measured) / 60), "what each choice is worth")
            measured[names] = _error(mended(changes), theory)
        return measured[names]

    as_it_is = errors[nearest]
    needed: list[Change] = []
    every_change = _enough(changes_at, robot.model.opt.timestep, accuracy, error_of)
    if as_it_is > accuracy:
        needed = _fewest(every_change, max(accuracy, _LOOSE * error_of(every_change)), error_of)
    ranked = _by_effect(needed, error_of)
    spared = [each for each in every_change if each.name not in {one.name for one in needed}]
    return Checked(
        theory, ended, path, as_it_is,
        since=float(times[since[0]]) if len(since) else None,
        others={name: error for name, error in errors.items() if name != nearest},
        motion=motion,
        seen=seen,
        needed=[
            (change, error_of(ranked[: i + 1]), error_of([*ranked[:i], *ranked[i + 1 :]]))
            for i, change in enumerate(ranked)
        ],
        spared=[(each, error_of([*ranked, *spared[: i + 1]])) for i, each in enumerate(spared)],
        edit=edit,
        text=edit.changed(ranked),
        mended=mended(ranked),
        mended_error=error_of(ranked),
    )  # fmt: skip


_LOOSE = 1.1  # times the least error, where the accuracy is out of reach
_Measure = Callable[[Sequence[Change]], float]


def _theories(
    own: UserModel, rolling: Rolling | None, times: Array
) -> dict[Rolling, tuple[Motion, str | None]]:
    """Return the motions of the rolling models, that of the contact's condim first.

    With each is the line of what ended it early, if anything did. Raises InputError where there is
    no motion.
    """
    found: dict[Rolling, tuple[Motion, str | None]] = {}
    refused = InputError("")
    default = rolling_of(own.robot.contact(own.begin()))
    for each in [rolling] if rolling else sorted(get_args(Rolling), key=lambda it: it != default):
        scene = own.scene(each, float(times[-1]))
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", SceneWarning)
                motion = integrate(scene, times)
            short = len(motion.times) < len(times)
            found[each] = motion, (str(caught[-1].message) if short else None)
        except InputError as error:
            unlikely = "; ".join(_unlikely(scene))
            refused = InputError(f"{error}{unlikely and f'; perhaps {unlikely}'}")
    if not found:
        raise refused
    return found


def _check_no_drive_from_outside(robot: RobotFile, seen: Seen) -> None:
    """Raise InputError where a body that is no part of the robot touches its sphere."""
    model = robot.model
    root = model.body_rootid[model.geom_bodyid]
    for pair in seen.inside:
        for i in pair:
            if robot.sphere in pair and root[i] not in (0, root[robot.sphere]):
                raise InputError(
                    f"{robot.path}: {_geom_name(model, i)} touches the sphere, and is no part of "
                    "its robot: a drive by contact is not supported; hold it by joints"
                )


def _touching(model: Any, seen: Seen) -> set[int]:
    """Return the bodies that touch others than the plane."""
    return {int(model.geom_bodyid[each]) for pair in seen.inside for each in pair}


def _enough(
    changes_at: Callable[[float], list[Change]], step: float, accuracy: float, error_of: _Measure
) -> list[Change]:
    """Return all changes, with the longest step that reaches the accuracy, or the best one."""
    while 2 * step > _SOFTEST:  # steps that would soften the contact
        step /= 2
    found = [changes_at(step)]
    while error_of(found[-1]) > accuracy and step / 2 >= _LEAST_STEP:
        step /= 2
        found.append(changes_at(step))
    return min(found, key=lambda each: max(error_of(each), accuracy))


def _carrying(changes: list[Change], own: UserModel, theory: Motion) -> list[Change]:
    """Return the changes with the margin at which the contact carries the load from the start.

    A sphere that just touches has no normal force at first, and slips: 1e-3 of the path and more.
    own: the model with the changes.
    """
    robot, data, force = own.robot, own.begin(), np.zeros(6)
    model, load = robot.model, float(theory.loads.contact_force[0, 2])
    sphere = np.flatnonzero((model.pair_geom1 == robot.sphere) | (model.pair_geom2 == robot.sphere))

    def excess(margin: float) -> float:
        model.pair_margin[sphere] = margin
        mujoco.mj_forward(model, data)
        carried = 0.0
        for i, contact in enumerate(data.contact):
            if robot.sphere in (contact.geom1, contact.geom2):
                mujoco.mj_contactForce(model, data, i, force)
                carried += force[0]
        return carried - load

    guess = theory.scene.gravity * (1 - _SOLIMP[1]) * float(model.pair_solref[sphere[0], 0]) ** 2
    with warnings.catch_warnings(action="ignore"):
        found = root_scalar(excess, x0=guess, x1=1.1 * guess)
    margin = float(found.root)
    if not (found.converged and 0 < margin < _STANDS * theory.scene.ball.radius):
        return changes
    return [
        replace(each, pair={**each.pair, "margin": _digits(margin)})
        if each.name == "softness"
        else each
        for each in changes
    ]


def _fewest(changes: Sequence[Change], limit: float, error_of: _Measure) -> list[Change]:
    """Return what is left where each change goes without which the error keeps to the limit."""
    needed, before = list(changes), None
    while needed != before:  # as one may be needed only as long as another is there
        before = needed
        for each in reversed(before):  # the finer points first
            rest = [other for other in needed if other is not each]
            if error_of(rest) <= limit:
                needed = rest
    return needed


_DELIVERED = 0.95  # of the declared resistance: less is worth a word
_USUAL = 0.02  # relative: a gravity that is nearer to the Earth's is usual


def _unlikely(scene: Scene) -> Iterator[str]:
    """Yield what both motions have, and the author may not mean: gravity first, then gears."""
    if abs(scene.gravity / GRAVITY - 1) > _USUAL:
        yield f"gravity: it is {scene.gravity:g} m/s², where the Earth's is {GRAVITY:g}"
    inside = {link.name: link for link in scene.ball.tree[1:]}
    levers = sum(link.mass * float(np.linalg.norm(link.centre)) for link in inside.values())
    times = np.linspace(0.0, scene.duration, 101)
    for each in scene.actuators:
        law, command = each.law, as_drive(each.command, scene.duration)
        # A servo's torque falls as it follows; a motor's does not.
        lasts = not (law.per_angle or law.per_rate)
        torque = float(np.abs(law.torque(command.rate(times), 0.0, 0.0)).max())
        for name, gear in each.gears:
            slides = inside[name].slides
            holds = scene.gravity * (inside[name].mass if slides else levers)
            if lasts and torque * abs(gear) > holds > 0:
                yield (
                    f"gear: {each.name} puts {torque * abs(gear):.3g} {'N' if slides else 'N m'} "
                    f"on {name} by a gear of {gear:g}, against weights of {holds:.3g}"
                )


def _by_effect(changes: Sequence[Change], error_of: _Measure) -> list[Change]:
    """Return the changes in an order in which each takes away most of the error that is left."""
    left, made = list(changes), list[Change]()
    while left:
        made.append(min(left, key=lambda each: error_of([*made, each])))
        left.remove(made[-1])
    return made


def moved(own: UserModel) -> tuple[UserModel, list[str]]:
    """Return a model that moves: itself, or with controls or a push; and words on these."""
    if not _stands(own):
        return own, []
    model, words = own.robot.model, "nothing moves it; it is checked with {}; see --control"
    radius = float(model.geom_size[own.robot.sphere, 0])
    gravity = float(np.linalg.norm(model.opt.gravity))
    torque = _TORQUE * float(model.body_subtreemass[0]) * gravity * radius
    controls: dict[str, Drive] = {}
    for name, gears in gears_of(model).items():
        i, joints = own.actuators[name], [*gears]
        scale = float(model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0])
        _, angle, rate = model.actuator_biasprm[i, :3]
        value = _ANGLE if angle else _RATE if rate else torque / (abs(scale) or 1.0)
        if model.actuator_ctrllimited[i]:
            value = min(value, float(model.actuator_ctrlrange[i, 1]) / 4)
        slides = np.any(model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_SLIDE))
        if slides or (np.any(model.jnt_limited[joints]) and not angle):
            value = 0.0  # it would soon reach its range
        controls[name] = Constant(value)
    if not controls:
        push = float(np.sqrt(gravity * radius)) / 2
        return replace(own, push=push), [words.format(f"a push, rolling at {push:.2g} m/s")]
    given = ", ".join(f"{name}={value.rate(0.0):.3g}" for name, value in controls.items())
    return replace(own, controls=controls), [words.format(given)]


def _stands(own: UserModel) -> bool:
    """Return whether a model without controls, started at rest, stays where it is."""
    data, robot = own.begin(), own.robot
    if own.controls or np.any(data.ctrl) or np.any(data.qvel):
        return False
    step = robot.model.opt.timestep
    path = own.path(step * round(1 + 0.1 / step) * np.arange(20))
    return bool(np.nanmax(np.abs(path)) < _STANDS * robot.model.geom_size[robot.sphere, 0])


COLUMNS = (
    Column("change", "change", words=True),
    Column("path error\nafter it", "error"),
    Column("it alone\nundone", "undone"),
    Column("what it mends", "words", words=True),
)


def study_of(own: UserModel, checked: Checked, accuracy: float, words: Sequence[str]) -> Study:
    """Return the table, record, picture and words of a checked model; words: known before."""
    theory, file = checked.theory, own.robot.path
    rows = [_line("as it is", checked.error)]
    rows += [
        _line(f"+ {each.name}", error, undone, each.words) for each, error, undone in checked.needed
    ]
    rows += [_line(f"({each.name})", error, words=each.words) for each, error in checked.spared]
    lines = [*words, *_verdict(checked, accuracy), *_symptoms(own, checked)]
    if checked.needed:
        reached = "" if checked.mended_error <= accuracy else f", more than {accuracy:g}"
        error = scientific(checked.mended_error)
        lines.append(f"mended: path error {error}{reached}")
    return Study(
        file.stem, None, ["check"], rows,
        record={
            "file": str(file),
            "rolling": theory.scene.rolling,
            "duration": float(theory.times[-1]),
            "accuracy": accuracy,
            "path_error": known(checked.error),
            "since": checked.since,
            "other_rolling": {name: known(each) for name, each in checked.others.items()},
            "causes": causes_of(checked, accuracy),
            "lines": lines,
            "changes": rows,
            "mended_error": known(checked.mended_error),
        },
        shown=(
            f"[bold]{escape(file.name)}[/]",
            *map(escape, lines),
            *([table_of(COLUMNS, rows)] if len(rows) > 1 else []),
        ),
        picture=_check_picture(file.name, checked, accuracy),
    )  # fmt: skip


def _line(
    change: str, error: float, undone: float | None = None, words: str = ""
) -> dict[str, Any]:
    return {"change": change, "error": known(error), "undone": known(undone), "words": words}


def causes_of(checked: Checked, accuracy: float) -> list[str]:
    """Return the causes of an error, the first one first."""
    causes = [f"{change.name}: {change.words}" for change, *_ in checked.needed]
    causes += [f"limit: {checked.ended}"] if checked.ended else []
    for line in _unlikely(checked.theory.scene):
        # A gear is in both motions, and the cause only where nothing else is.
        first = line.startswith("gravity") or checked.mended_error > accuracy
        causes.insert(0 if first else len(causes), line)
    if not causes and checked.error > accuracy:
        causes.append(
            "unknown: no choice of the recipe helps; a sensitive motion leaves any path in time, "
            "so try a shorter --duration"
        )
    return causes


def _verdict(checked: Checked, accuracy: float) -> Iterator[str]:
    """Yield how far the model is off, by which rolling model, and the first cause."""
    theory, error = checked.theory, checked.error
    off = f"path error {scientific(error)}" if np.isfinite(error) else "diverges"
    length, end = theory.path_length, theory.times[-1]
    when = "" if checked.since is None else f", beyond {accuracy:g} from t = {checked.since:.2g} s"
    yield f"as it is: {off} over a path of {length:.3g} m in {end:.3g} s{when}"
    others = "".join(f" ({name}: {scientific(each)})" for name, each in checked.others.items())
    yield f"rolling: {theory.scene.rolling}{others}"
    for cause in causes_of(checked, accuracy)[:1]:
        yield f"cause: {cause}"


def _symptoms(own: UserModel, checked: Checked) -> Iterator[str]:
    """Yield what contacts, joints and servos do that the path alone does not show."""
    seen, theory, report = checked.seen, checked.theory, checked.motion.report
    lost = [each for each in report.faults if each.kind is FaultKind.CONTACT_LOST]
    if lost:
        aloft = np.isnan(report.depth).mean()
        yield f"contact: lost for {aloft:.2%} of the time, first at t = {lost[0].time:.3g} s"
    radius = theory.scene.ball.radius
    rolled = max(checked.motion.path_length, _STANDS * radius) / report.timestep
    yield f"slip: {scientific(report.slip.sum() / rolled)} of the path"
    if theory.scene.rolling == "rubber":
        yield f"spin: {scientific(radius * np.abs(report.spin).sum() / rolled)} of the path"
    if seen.delivered is not None:
        yield (
            f"rolling resistance: {theory.scene.friction.rolling:g} m is declared, which is in the "
            f"reference; the contact delivers {seen.delivered:.0%} of it"
        )
    for (a, b), part in seen.inside.most_common(_MOST_PAIRS):
        names = [_geom_name(own.robot.model, each) for each in (a, b)]
        yield f"inside: {names[0]} touches {names[1]} in {part:.0%} of the steps"
    for name, time in seen.limits.items():
        yield f"limit: {name} reaches its range at t = {time:.3g} s"
    for name, lag in seen.lag.items():
        if lag > _LAGS:
            yield f"servo: {name} misses its command by {lag:.0%} (root mean square)"


def difference(checked: Checked) -> list[str]:
    """Return the lines in which the mended file differs from the user's, as a diff has them."""
    before, after = (text.splitlines() for text in (checked.edit.source, checked.text))
    return list(difflib.unified_diff(before, after, "as it is", "mended", n=0, lineterm=""))[
        :_MOST_LINES
    ]


def _check_picture(name: str, checked: Checked, accuracy: float) -> Figure:
    """Draw the paths, and the errors over time, as it is and mended."""
    theory = checked.theory
    figure = Figure(figsize=(11.0, 5.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    wide = {"color": theory.engine.colour, "lw": 5, "alpha": 0.6}
    left.plot(*theory.contact_point.T, **wide, label="equations")
    found = []
    drawn: list[tuple[str, Array, str, Any]] = [("as it is", checked.path, LABEL.colour, "-")]
    if checked.needed:
        own, dashes, _ = PRESET_LOOKS["mended"]
        drawn.append(("mended", checked.mended, own, (0, dashes)))
    for label, path, colour, dash in drawn:
        # Its end is marked, as a path may end within another.
        left.plot(*path.T, ls=dash, marker="o", markevery=[-1], ms=8, color=colour, label=label)
        away = _away(path, theory)
        right.semilogy(theory.times[1:], away[1:], ls=dash, color=colour, label=label)
        rolled = np.linalg.norm(path - path[0], axis=1).max() > _STILL * theory.path_length
        off = f"{scientific(known(away.max()))} of the path off"
        found.append(f"{label} {off if rolled else 'it stands still'}")
    title(figure, f"{name}: {', '.join(found)}")
    left.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal", title="contact point")
    left.set_adjustable("datalim")
    if not np.any(theory.contact_point) or not np.any(path):
        right.set_yscale("linear")
    right.axhline(accuracy, color="gray", linestyle=":", label="asked for")
    right.set(xlabel="t [s]", title="path error over the path's length")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    return figure


_MOST_PAIRS, _LAGS = 5, 0.1
_MOST_LINES = 60  # of a diff
_STILL = 0.01  # part of the path below which a ball stands still
