"""Check a user's model: find the fewest changes with which its file rolls right.

The file is run with sets of changes, each set once. The worth of a change is the path error that
is left with all needed changes except this one.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from robotball import InputError
from robotball.engines.mujoco.user_model import ALOFT_HEIGHT, Obstacle, UserModel, observed
from robotball.errors import mujoco_silent
from robotball.motion import Motion, measured_time
from robotball.robot.formulas import Rolling
from robotball.rotations import Array
from robotball.user_model.mended_file import Change, Editable
from robotball.user_model.robot_file import start_misses

from ..output import Show
from .observe import Observation, observe, path_error, resistance_per_deceleration
from .propose import editable_file, proposals, steps_of, too_high_gain

_PATIENCE = 20.0  # s of processor time for all trials
_FEWEST_SAMPLES = 5  # of a comparison that ends at an obstacle
_MORE_RUNS = 4  # than changes, which the patience must allow for
_STOPS = 10.0  # s, in which a rolling friction is to stop a ball
_LOOSE = 1.1  # times the smallest error: the limit if the accuracy is out of reach


class Resistance(NamedTuple):
    """The rolling friction [m] that stops a ball with a speed [m/s] with a deceleration [m/s²].

    delivered: the part of it that MuJoCo exerts, for each cone.
    """

    speed: float
    deceleration: float
    friction: float
    delivered: dict[str, float]


@dataclass(frozen=True)
class Checked:
    """The outcome of a check.

    Attributes
    ----------
    observation : Observation
    duration : float, s
        The time that was asked for.
    short : str or None
        Why less time was compared.
    tried : float, s
        The duration of each trial.
    needed : sequence of (Change, float)
        The fewest changes that help, with the path error without each, the largest first.
    spared : sequence of Change
        The other proposals.
    source, text : str
        The file, and the mended file.
    mended : (n, 4), m
        The path of the mended file over the whole comparison.
    resistance : Resistance or None
        If nothing stops the ball.
    """

    observation: Observation
    duration: float
    short: str | None
    tried: float
    needed: Sequence[tuple[Change, float]]
    spared: Sequence[Change]
    source: str
    text: str
    mended: Array
    resistance: Resistance | None

    @property
    def agrees(self) -> bool:
        """Whether the file moves and rolls as the reference does, all the time asked for."""
        seen = self.observation
        fails = seen.failure or self.short or seen.user.robot.repairs
        return not fails and seen.error <= seen.accuracy

    @property
    def is_changed(self) -> bool:
        """Whether there is a mended file."""
        return bool(self.needed or self.observation.user.robot.repairs)

    @property
    def mended_error(self) -> float:
        """The path error of the mended file."""
        return path_error(self.mended, self.observation.theory)


@mujoco_silent()  # a diverged state is reported in words
def check_model(
    user: UserModel, rolling: Rolling | None, duration: float, accuracy: float, show: Show
) -> Checked:
    """Check a user's model against ideal rolling.

    rolling: the nearer model if None. duration [s]: less is compared if the robot meets an
    obstacle, or all would take too long. accuracy: the path error to reach. show: called with the
    finished part and the next piece of work.
    """
    short, compared = None, duration
    while True:
        try:
            observation = observe(user, rolling, compared, accuracy, show)
        except InputError as refusal:
            if gain := too_high_gain(user):
                raise InputError(f"{refusal}; perhaps the gain: {gain.words}") from None
            raise
        trials, obstacle = _first_trials(observation, show)
        if obstacle is None:
            break
        # The equations leave out the obstacle, so compare again, up to shortly before it.
        compared = obstacle.time - 2 * observation.interval
        short = f"ends early: {obstacle.words} at t = {obstacle.time:.3g} s of {duration:.3g} s"
    theory, end = observation.theory, observation.theory.times[-1]
    if theory.ended:
        short = f"limit: {theory.ended} of {duration:.3g} s"
    elif end < observation.duration - observation.interval / 2:
        short = f"only {end:.3g} s of {duration:.3g} s are checked: the rest would take too long"
    changes, needed = trials.changes, list[tuple[Change, float]]()
    if observation.judged and (observation.failure or observation.error > accuracy):
        changes = _sufficient(trials)
        needed = _fewest(trials, changes, max(accuracy, _LOOSE * trials.error(changes)))
    robot = observation.user.robot
    made = [change for change, _ in needed]
    whole, source = len(trials.times) == len(theory.times), trials.edit.source
    if robot.repairs:  # a URDF is mended as MuJoCo writes it
        source = robot.path.read_text()
        source = source if "<mujoco" in source else user.robot.spec.to_xml()
    return Checked(
        observation,
        duration,
        short,
        tried=float(trials.times[-1]),
        needed=needed,
        spared=[change for change in changes if change not in made],
        source=source,
        text=trials.edit.changed(made),
        mended=trials.path(made) if whole else trials.changed(made).path(theory.times),
        resistance=_resistance(observation, trials.edit),
    )


def _resistance(seen: Observation, edit: Editable) -> Resistance | None:
    """Return the rolling friction that a rolling ball without any needs to stop."""
    theory, ratio = seen.theory, resistance_per_deceleration(seen.theory.scene)
    times = theory.times[theory.times <= _STOPS / 2]
    half = len(times) // 2
    slips = any(end > times[half] for _, end in theory.slipping)
    if ratio is None or slips or half < _FEWEST_SAMPLES or seen.contact.dim in (1, 6):
        return None
    step = np.diff(theory.contact_point[-2:], axis=0)
    speed = float(np.linalg.norm(step)) / seen.interval
    if speed * _STOPS < seen.user.robot.radius:
        return None
    braking, delivered = speed / _STOPS, {}
    friction = ratio * braking
    numbers = " ".join(f"{it:.9g}" for it in (*seen.contact.friction[:3], friction, friction))
    for cone in ("elliptic", "pyramidal"):
        pair = {"condim": "6", "friction": numbers}
        text = edit.changed([Change("", "", option={"cone": cone}, pair=pair)])
        points = seen.user.with_text(text).path(times)[half:, :2]
        away = np.linalg.norm(points - points[0], axis=1)
        delivered[cone] = float(-2 * np.polyfit(times[half:], away, 2)[0] / braking)
    return Resistance(speed, braking, friction, delivered)


@dataclass(frozen=True)
class _Trials:
    """Runs of a file with sets of changes.

    changes: all of them, with the file's timestep. times (n,) [s]: the samples of every run.
    paths: (n, 4) [m] for each set that was run.
    """

    observation: Observation
    edit: Editable
    changes: list[Change]
    times: Array
    paths: dict[frozenset[str], Array]
    show: Show

    def path(self, changes: Sequence[Change]) -> Array:
        """Return the path (n, 4) of the file with changes."""
        key = frozenset(map(str, changes))
        if key not in self.paths:
            done = 0.4 + 0.6 * len(self.paths) / (len(self.changes) + _MORE_RUNS)
            self.show(min(0.95, done), "the worth of each change")
            self.paths[key] = self.changed(changes).path(self.times)
        return self.paths[key]

    def error(self, changes: Sequence[Change]) -> float:
        """Return the path error of the file with changes."""
        return path_error(self.path(changes), self.observation.theory)

    def evaluations(self, changes: Sequence[Change]) -> float:
        """Return the evaluations of the forces per second of the file with changes."""
        option = self.changed(changes).robot.model.opt
        stages = 4 if option.integrator == int(mujoco.mjtIntegrator.mjINT_RK4) else 1
        return float(stages / option.timestep)

    def lifts(self, changes: Sequence[Change]) -> bool:
        """Return whether the file with changes leaves the plane, or starts inside it."""
        height, limit = self.path(changes)[:, 2], ALOFT_HEIGHT * self.observation.user.robot.radius
        return bool(np.nanmax(height) > limit or height[0] < -limit)

    def changed(self, changes: Sequence[Change]) -> UserModel:
        """Return the model of the file with changes."""
        return self.observation.user.with_text(self.edit.changed(changes))


def _first_trials(observation: Observation, show: Show) -> tuple[_Trials, Obstacle | None]:
    """Run the file with all changes. Return the trials to go on with, and the first obstacle.

    Trials are shortened so that all of them take no longer than `_PATIENCE`, but not to less than
    the file needs to exceed the accuracy. Raises InputError for an obstacle at the start.
    """
    user, symptoms, times = observation.user, observation.symptoms, observation.theory.times
    edit = editable_file(observation)
    changes = proposals(observation, edit, steps_of(user, longest=np.inf)[0])
    early = symptoms.obstacle
    # Bodies that collide or a high gain may stop the robot before a wall, or throw it at one.
    if first := [change for change in changes if change.name in ("contacts", "gain")]:
        _, early = user.with_text(edit.changed(first)).path_to_obstacle(times)
    elif early and early.time > times[-1]:
        early = None
    mended, began = user.with_text(edit.changed(changes)), time.process_time()
    path, late = mended.path_to_obstacle(times)
    cost = measured_time(time.process_time() - began) / len(times)
    obstacle = min(filter(None, (early, late)), default=None)
    if obstacle and obstacle.time < _FEWEST_SAMPLES * observation.interval:
        if not symptoms.diverged:
            misses = "".join(f"; {miss}" for miss, _ in start_misses(user.robot, user.begin()))
            line = f"{obstacle.words} at t = {obstacle.time:.3g} s, too soon for a comparison"
            raise InputError(f"{user.robot.path}: {line}{misses}")
        obstacle = None  # a state that diverges at once may touch anything
    since = observation.since
    least = 2 if since is None else 2 + int(1.2 * round(since / observation.interval))
    # A run with all changes costs the most.
    times = times[: max(least, int(_PATIENCE / ((len(changes) + _MORE_RUNS) * cost)))]
    paths = {frozenset(map(str, changes)): path[: len(times)]}
    return _Trials(observation, edit, changes, times, paths, show), obstacle


def _sufficient(trials: _Trials) -> list[Change]:
    """Return all changes that reach the accuracy with the fewest evaluations, or else the best."""
    tried, accuracy = list[list[Change]](), trials.observation.accuracy

    def worth(changes: list[Change]) -> tuple[float, float]:
        return max(trials.error(changes), accuracy), trials.evaluations(changes)

    for implicit in (True, False):
        before = np.inf
        for step in steps_of(trials.observation.user):
            changes = proposals(trials.observation, trials.edit, step, implicit)
            if (accuracy, trials.evaluations(changes)) >= min(map(worth, tried), default=(np.inf,)):
                break  # another integrator needs fewer
            tried.append(changes)
            after = trials.error(changes)
            if after <= accuracy or before / 2 <= after < np.inf:
                break  # shorter steps do not help
            before = after
    return min(tried, key=worth)


def _fewest(trials: _Trials, changes: Sequence[Change], limit: float) -> list[tuple[Change, float]]:
    """Return the fewest changes with an error within the limit, with the error without each.

    The largest error comes first. Fine points, which are last, are left out before other changes.
    """

    def without(change: Change, needed: Sequence[Change]) -> float:
        return trials.error([other for other in needed if other is not change])

    def fails(change: Change, needed: Sequence[Change]) -> bool:
        others = [other for other in needed if other is not change]
        return trials.error(others) > limit or (trials.lifts(others) and not trials.lifts(changes))

    needed, before = list(changes), None
    while needed != before:  # a change may be needed only as long as another is there
        before = needed
        for change in changes[::-1]:
            if change in needed and not fails(change, needed):
                needed = [other for other in needed if other is not change]
    worth = [(change, without(change, needed)) for change in needed]
    # A ball that leaves the plane may come back to its path.
    start = [change for change, _ in worth if change.start and trials.observation.failure]
    return sorted(worth, key=lambda it: (np.isfinite(it[1]), it[0] not in start, -it[1]))


def motions_of(checked: Checked) -> list[Motion]:
    """Return the motions of the file, of the mended file if it is changed, and of the reference.

    A run that diverged at once has no motion.
    """
    seen, motions = checked.observation, [checked.observation.motion]
    if checked.needed:
        mended, error = seen.user.with_text(checked.text), checked.mended_error
        every = round(seen.interval / mended.robot.model.opt.timestep)
        motions.append(observed(mended, seen.motion.scene, error, every, name="mended")[0])
    return [*(run for run in motions if len(run.times) > 1), seen.theory]
