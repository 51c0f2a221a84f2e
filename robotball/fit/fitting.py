"""Fit the numbers of a scene, such as masses and gains, to logs of a robot's sensors.

Least squares over the unknowns of `residuals`; `evidence` evaluates the minimum. A fit starts with
the first part of each motion, because with a wrong guess a motion soon loses phase with the log.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from robotball.errors import InputError, named, unknown
from robotball.files.scene_tables import Numbers
from robotball.fit import evidence
from robotball.fit.evidence import NO_EVIDENCE, Estimate, SensorFit, chi2_of
from robotball.fit.first import first_values
from robotball.fit.logs import Log, logs_of, reordered
from robotball.fit.residuals import (
    WHOLE,
    FittedLog,
    Residuals,
    Unknown,
    by_equations,
    of_log,
    of_scene,
)
from robotball.fit.scene_numbers import numbers_of
from robotball.robot.ball import Value
from robotball.robot.scene import Scene
from robotball.rotations import Array

_Solve = Callable[[Sequence[FittedLog]], tuple[Array, Residuals, Array, bool]]

_PARTS = (0.15, 0.4, 1.0)  # of the logs; these parts are fitted one after the other
_PRIOR = 1.0  # of an unknown's size: prior standard deviation while fitting part of a log
_HARDLY = 1e-2  # per size: weak prior for unknowns of a start that have no effect
_NO_GAIN = 0.1  # decrease of χ² at which the fit stops; the last steps do the rest
_ROUGHLY = 1e-2  # relative decrease of χ² at which a part of the logs is finished
# Last steps, which use central differences, and the fractions of a step that are tried. The fit has
# converged if no fraction lowers χ² by more than _SHORT.
_LAST_STEPS, _FRACTIONS, _SHORT = 3, (1.0, 0.25, 0.06), 1.0
# The needed friction divided by the friction: below _REACHED the friction has no effect, and a
# lower friction with the ratio 1/_LOWERED is tried.
_REACHED, _LOWERED = 0.999, 0.9
_MOST_TRIALS = 40  # per part of the logs, so that a hopeless fit ends within seconds


@dataclass(frozen=True)
class Fit(Value):
    """Hold a scene that was fitted to logs, with the evidence for it.

    Attributes
    ----------
    scene : Scene
        The fitted scene, with the initial state of the first log.
    text : str
        The text of its scene file.
    found : tuple of Estimate
        The numbers of the scene.
    of_logs : tuple of Estimate
        The fitted circumstances of the logs.
    correlations : (p, p)
        The correlations of the numbers of the scene.
    chi2, degrees : float, int
        The sum of (residual / noise)², and the degrees of freedom.
    probability : float
        The probability of a χ² at least as large, if the model is right. If noise is estimated from
        the readings, the distribution is wider.
    sensors : tuple of SensorFit
        Each sensor of each fitted log.
    held_out : tuple of SensorFit
        Each sensor of the held-out log.
    undetermined : tuple of str
        Quantities that the logs do not constrain, one line each.
    contradictions : tuple of str
        Pairs of sensors that contradict each other with any model, one line each.
    at_limits : tuple of str
        Numbers that ended at a limit, one line each.
    reason : str
        The most probable reason why the model does not explain the fitted logs; "" if it does.
    influences : tuple of str
        Circumstances that were not fitted and may have biased a number, one line each.
    moving : tuple of str
        If the fit did not converge, the numbers that the next step would change, one line each.
    complete : bool
        Whether the fit converged to a minimum of χ².

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", 2.0)
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> result = rb.fit("pendulum_robot", log, ["frame.kv"], noise={"gyro": 0.02})
    >>> result.explains, result.undetermined
    (True, ())
    """

    scene: Scene
    text: str
    found: tuple[Estimate, ...]
    of_logs: tuple[Estimate, ...]
    correlations: Array
    chi2: float
    degrees: int
    probability: float
    sensors: tuple[SensorFit, ...]
    held_out: tuple[SensorFit, ...]
    undetermined: tuple[str, ...]
    contradictions: tuple[str, ...]
    at_limits: tuple[str, ...]
    reason: str
    influences: tuple[str, ...]
    moving: tuple[str, ...]
    complete: bool

    @property
    def explains(self) -> bool:
        """Whether the model explains all logs, including the held-out one."""
        return not self.strays

    @property
    def strays(self) -> tuple[SensorFit, ...]:
        """The sensors that the model fails to explain, the worst first."""
        return tuple(evidence.strays((*self.sensors, *self.held_out)))


def fit(
    scene: Numbers | Scene | str | Path,
    logs: Log | str | Path | Sequence[Log | str | Path],
    free: Sequence[str],
    *,
    circumstances: Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    patience: float = np.inf,
    hold_out: int | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Fit:
    """Fit numbers of a scene to the logs of a robot.

    Parameters
    ----------
    scene : Numbers, Scene, str or Path
        The robot, with the initial values of the fit.
    logs : Log, str, Path or sequence of these
        One or more logs: files, or logs from `read_log`.
    free : sequence of str
        The numbers to fit. Each is given by its path in the scene file or by the last words of this
        path, such as "battery.mass". Limits are given as in "frame.kv=0.1:0.8". "frame.inertia" and
        "pendulum1.inertia" stand for the mass, centre and inertia of the whole body, instead of the
        numbers of its parts.
    circumstances : sequence of str, optional
        Quantities to fit for each log, such as "world.yaw", "world.origin", "position.marker",
        "gyro.bias", "accelerometer.place", "commands.delay", "attitude.clock", "frame_angle.zero".
    noise : mapping of str to float, optional
        The standard deviation of each sensor's readings, in the unit of the readings. The default
        is estimated from the readings.
    patience : float, default inf
        The longest time for the search [s]. After this time the best values so far are returned.
    hold_out : int, optional
        The index of a log that is not fitted, but used to test the fit of the others.
    progress : callable, optional
        Called with the fraction of the logs that is fitted, and with χ² divided by the degrees of
        freedom.

    Returns
    -------
    Fit
        The fitted scene, its numbers with their standard deviations, and how well it explains each
        sensor.

    Raises
    ------
    InputError
        If a name is unknown, a log has too few readings, or the initial scene cannot be run.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.integrate("pendulum_robot", 2.0).save("run.csv")
    >>> noise = {"position": 1e-3, "attitude": 1e-2, "gyro": 2e-2, "frame_angle": 1e-2}
    >>> noise.update(frame_rate=2e-2, frame_torque=1e-2)
    >>> result = rb.fit("pendulum_robot", "run.csv", ["frame.kv"], noise=noise)
    >>> print(f"{result.found[0].value:.3f}")
    0.400
    """
    whole = [name.removesuffix(WHOLE) for name in free if name.endswith(WHOLE)]
    numbers = numbers_of(scene).with_whole(whole)
    initial = numbers.scene({})
    logs = logs_of(logs, initial)
    names = {sensor.name for log in logs for sensor in log.sensors}
    for name in noise or {}:
        if name not in names:
            raise unknown("sensor of the logs", name, sorted(names))
    shared = of_scene(numbers, free, initial.ball.radius)
    deadline = time.monotonic() + patience
    solve = partial(_solved, numbers, circumstances=circumstances, deadline=deadline)
    first = partial(first_values, initial, noise=noise or {}, freed=circumstances)
    sensed = [first(log) for log in logs]
    fitted = [log for k, log in enumerate(sensed) if k != hold_out]
    if not fitted:
        raise InputError("all logs are held out: add a log to fit")
    x, residuals, J, complete = solve(shared, fitted, progress=progress)
    left = residuals(x)
    estimates, covariance, undetermined = evidence.estimates_at(residuals, x, J, complete)
    found = tuple(estimates[: len(shared)])
    sensors = [*evidence.sensor_fits(residuals, x, len(x) / len(left))]
    held_out: list[SensorFit] = []
    if hold_out is not None:
        # For the held-out log only the initial state is fitted.
        fixed = {estimate.name: estimate.value for estimate in found}
        y, others, *_ = solve([], [sensed[hold_out]], fixed=fixed)
        held_out = [*evidence.sensor_fits(others, y, len(y) / len(others(y)))]
    fitted_scene = residuals.scene(0, residuals.values(x))
    block = covariance[: len(shared), : len(shared)]
    scale = np.sqrt(np.diag(block))
    # Unknowns of an initial state that have no effect do not count.
    of_scene_ = np.array([unknown.log is None for unknown in residuals.unknowns])
    felt = of_scene_ | (np.linalg.norm(J, axis=0) > 0)
    chi2, degrees = chi2_of(left), max(len(left) - int(felt.sum()), 1)
    estimated = any(flag for log in fitted for flag in log.estimated)
    strays = evidence.strays(sensors)
    contradictions = tuple(evidence.contradicting(logs, evidence.strays([*sensors, *held_out])))
    reason = contradictions[0] if strays and contradictions else ""
    if strays and not contradictions:
        residuals.deadline = deadline
        with suppress(TimeoutError):
            swapped = [first(reordered(log.log)) for log in fitted]
            reason = _of_order(residuals, chi2, swapped, partial(solve, shared))
            reason = reason or evidence.reason(residuals, x, J, strays[0])
        residuals.deadline = np.inf
    return Fit(
        scene=fitted_scene,
        text=numbers.text({estimate.name: estimate.value for estimate in found}, fitted_scene),
        found=found,
        of_logs=tuple(estimates[len(shared) :]),
        correlations=block / np.outer(scale, scale),
        chi2=chi2,
        degrees=degrees,
        probability=evidence.probability_of(chi2, degrees, len(left), estimated),
        sensors=tuple(sensors),
        held_out=tuple(held_out),
        undetermined=tuple(undetermined),
        contradictions=contradictions,
        at_limits=tuple(evidence.at_limits(residuals, x, not strays)),
        reason=reason,
        influences=() if strays else tuple(evidence.influences(residuals, x, J, found)),
        moving=() if complete else tuple(evidence.moving(residuals, x, J)),
        complete=complete,
    )


def _of_order(residuals: Residuals, chi2: float, logs: Sequence[FittedLog], solve: _Solve) -> str:
    """Return that `logs`, with quaternions in the order x, y, z, w, are explained; else "".

    They are fitted only if they are nearer to the motions from the first values.
    """
    chi2s = []
    for order in (logs, residuals.logs):
        starts = [start for k, log in enumerate(order) for start in of_log(log, k, ())]
        left = Residuals(residuals.numbers, starts, order, {})(np.zeros(len(starts)))
        chi2s.append(chi2_of(left))
    if not chi2s[0] < chi2s[1]:
        return ""
    x, others, *_ = solve(logs)
    title = "the quaternion's order is x, y, z, w: name its columns with --map"
    return evidence.explained(title, chi2, chi2_of(others(x)), len(others(x)))


def _solved(
    numbers: Numbers,
    shared: Sequence[Unknown],
    logs: Sequence[FittedLog],
    circumstances: Sequence[str],
    deadline: float,
    progress: Callable[[float, float], None] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> tuple[Array, Residuals, Array, bool]:
    """Return the solution, the residuals, their derivative and whether the fit converged."""
    unknowns = list(shared)
    for k, fitted_log in enumerate(logs):
        unknowns += of_log(fitted_log, k, circumstances)
    x = begin = np.zeros(len(unknowns))
    of_scene_ = np.array([unknown.log is None for unknown in unknowns])
    low, high = (
        np.array([(getattr(u, side) - u.value) / u.size for u in unknowns])
        for side in ("low", "high")
    )
    of_part = partial(Residuals, numbers, unknowns, fixed=fixed or {})
    try:
        for part in _PARTS:
            residuals = of_part([log.until(part) for log in logs], deadline=deadline)
            if part == _PARTS[0]:
                x = begin = _with_resistance(residuals, x, low, high)
            # The shorter part may have led to a motion that ends early.
            x = _possible(residuals, x, begin)
            count = len(residuals(x))
            # A part of the logs may hardly constrain an unknown; the prior keeps it near its last
            # value.
            prior = np.where(of_scene_, 1 / _PRIOR if part < 1 else NO_EVIDENCE, _HARDLY)
            with_prior = partial(_with_prior, residuals=residuals, prior=prior, begin=begin)
            # A trial may lead to an impossible body.
            jacobian = partial(_jacobian_with_prior, residuals=residuals, prior=prior)
            ftol = _NO_GAIN / count if part == 1 else _ROUGHLY
            solve = partial(least_squares, with_prior, jac=jacobian, bounds=(low, high))
            solve = partial(solve, ftol=ftol, max_nfev=_MOST_TRIALS)
            with np.errstate(over="ignore", invalid="ignore"):
                x = solve(x).x
                # A friction that no motion reaches has no effect, so a lower one is tried.
                lower = x.copy()
                for j, need in residuals.needs(x).items():
                    if need < _REACHED * residuals.values(x)[j]:
                        lower[j] = (_LOWERED * need - unknowns[j].value) / unknowns[j].size
                if (lower < x).any() and (lower >= low).all():
                    x = min(x, solve(lower).x, key=lambda end: chi2_of(with_prior(end)))
            if progress is not None:
                progress(part, chi2_of(with_prior(x)) / count)
        for _ in range(_LAST_STEPS):
            J, left = residuals.jacobian(x, central=True), with_prior(x)
            step = -np.linalg.lstsq(np.concatenate([J, np.diag(prior)]), left)[0]
            ends = [np.clip(x + part * step, low, high) for part in _FRACTIONS]
            nearest = min(ends, key=lambda end: chi2_of(with_prior(end)))
            if (gain := chi2_of(left) - chi2_of(with_prior(nearest))) > 0:
                x = nearest
            # Not judged by the predicted gain: rounding in J produces false slopes along a valley.
            if gain < _SHORT:
                break
    except TimeoutError:
        x = residuals.best[1] if np.isfinite(residuals.best[0]) else x
        residuals = of_part(logs)
        x = _possible(residuals, x, begin)
        return x, residuals, residuals.jacobian(x), False
    residuals.deadline = np.inf  # for the evidence
    return x, residuals, J, gain < _SHORT


def _with_resistance(residuals: Residuals, x: Array, low: Array, high: Array) -> Array:
    """Return x with the rolling friction that the tracks show, if this explains the logs better."""
    rolling = "friction.rolling"
    shown = [log.first[rolling] for log in residuals.logs if rolling in log.first]
    if not shown:
        return x
    better, value = x.copy(), float(np.median(shown))
    for j, number in enumerate(residuals.unknowns):
        if number.name == rolling:
            better[j] = np.clip((value - number.value) / number.size, low[j], high[j])
    return min(better, x, key=lambda at: chi2_of(residuals(at)))


def _with_prior(x: Array, residuals: Residuals, prior: Array, begin: Array) -> Array:
    return np.concatenate([residuals(x), prior * (x - begin)])


def _jacobian_with_prior(x: Array, residuals: Residuals, prior: Array) -> Array:
    return np.concatenate([residuals.jacobian(x), np.diag(prior)])


def _possible(residuals: Residuals, x: Array, begin: Array) -> Array:
    """Return x, or `begin` if x has no motion. Raises InputError if neither has one."""
    for trial in (x, begin):
        if np.isfinite(residuals(trial)).all():
            return trial
    for k, fitted in enumerate(residuals.logs):
        times = np.array([0.0, fitted.log.end])
        with named(fitted.log.name):
            try:
                by_equations(residuals.scene(k, residuals.values(begin)), times)
            except InputError as error:
                by_equations(residuals.numbers.scene({}), times)  # may itself have no motion
                cause, *_ = str(error).split(";")  # without its remedy
                raise InputError(
                    "the log does not fit this robot: from the initial state that its first "
                    f"readings give, {cause}; check the sensors' units, axes and noise"
                ) from error
    raise InputError("the scene, with its initial numbers, has no motion as long as the logs")
