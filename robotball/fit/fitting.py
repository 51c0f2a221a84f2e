"""Fit a scene to logs: which masses, places and gains explain what a robot's sensors read.

Least squares over the unknowns of `residuals`; `evidence` has what their minimum tells. A fit goes
from the first part of a motion to the whole, as a wrong guess is soon out of step with the log.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from robotball.errors import LARGEST, InputError, check_positive, named, unknown
from robotball.files.numbers import Numbers
from robotball.fit.evidence import (
    NO_EVIDENCE,
    Found,
    SensorFit,
    at_limits,
    chi2_of,
    contradicting,
    found_at,
    influences,
    probability_of,
    sensor_fits,
    strays,
)
from robotball.fit.logs import Log, logs_of
from robotball.fit.residuals import (
    FIRST,
    LOSSES,
    WHOLE,
    FittedLog,
    Residuals,
    Run,
    Unknown,
    by_equations,
    of_log,
    of_scene,
)
from robotball.fit.scene_numbers import numbers_of
from robotball.fit.sensing import FEWEST, noise_of
from robotball.robot.ball import Value
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array

_PARTS = (0.15, 0.4, 1.0)  # of the logs, to which the fit is made in turn
_PRIOR = 1.0  # of an unknown's size: how far a part of the logs may move it without evidence
_HARDLY = 1e-2  # per size: keeps a start that changes nothing where it is
_SMALLEST = 1e-7  # of a sensor's readings: what the equations and engines err by is no evidence
_NO_GAIN = 0.1  # of χ², where one more step, of the last derivative, takes what is left of it
_ROUGHLY = 1e-2  # of χ², relative, of a part of the logs, from which the fit goes on
# The last steps, by central differences, and the parts of a step that are tried. The fit is at its
# minimum if none of them lowers χ² by as much.
_LAST_STEPS, _FRACTIONS, _SHORT = 3, (1.0, 0.25, 0.06), 1.0
_MOST_TRIALS = 40  # of each part of the logs, so that a hopeless fit ends in seconds


@dataclass(frozen=True)
class Fit(Value):
    """Hold a scene that was fitted to logs.

    Attributes
    ----------
    scene : Scene
        The scene with the numbers found, which starts as the first log does.
    text : str
        The text of its scene file.
    found : tuple of Found
        The numbers of the scene.
    of_logs : tuple of Found
        The circumstances that were freed.
    correlations : (p, p)
        The correlations of the numbers of the scene.
    chi2, degrees : float, int
        The sum of the squared residuals over the noise, and the degrees of freedom.
    probability : float
        How probable a sum at least as large is, if the model is right.
    sensors : tuple of SensorFit
        Each sensor of each log that was fitted.
    held_out : tuple of SensorFit
        Each sensor of the log that was held out.
    undetermined : tuple of str
        What the logs cannot tell, a line each.
    contradictions : tuple of str
        Sensors that do not fit and contradict each other, whatever the model, a line each.
    at_limits : tuple of str
        Numbers that ended at a limit, a line each.
    influences : tuple of str
        Circumstances that were not freed and may have moved a number, a line each.
    complete : bool
        Whether the fit came to a minimum of χ², and did not stop before.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", 2.0)
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> found = rb.fit("pendulum_robot", log, ["frame.kv"], noise={"gyro": 0.02})
    >>> found.explains, found.undetermined
    (True, ())
    """

    scene: Scene
    text: str
    found: tuple[Found, ...]
    of_logs: tuple[Found, ...]
    correlations: Array
    chi2: float
    degrees: int
    probability: float
    sensors: tuple[SensorFit, ...]
    held_out: tuple[SensorFit, ...]
    undetermined: tuple[str, ...]
    contradictions: tuple[str, ...]
    at_limits: tuple[str, ...]
    influences: tuple[str, ...]
    complete: bool

    @property
    def explains(self) -> bool:
        """Whether the model explains the logs, those held out too."""
        return not self.strays

    @property
    def strays(self) -> tuple[SensorFit, ...]:
        """The sensors whose readings the model does not explain, the worst first."""
        return tuple(strays((*self.sensors, *self.held_out)))


def fit(
    scene: Numbers | Scene | str | Path,
    logs: Log | str | Path | Sequence[Log | str | Path],
    free: Sequence[str],
    *,
    circumstances: Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    loss: str = "linear",
    hold_out: int | None = None,
    run: Run | None = None,
    minimize: Callable[..., Any] | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Fit:
    """Fit numbers of a scene to the logs of a robot.

    Parameters
    ----------
    scene : Numbers, Scene, str or Path
        The robot, with the numbers from which the fit begins.
    logs : Log, str, Path or sequence of these
        One log or more: files, or logs as `read_log` returns them.
    free : sequence of str
        The numbers to be found, by their paths in the scene file or the last words of these, such
        as "battery.mass"; with limits as "frame.kv=0.1:0.8". "frame.inertia" and
        "pendulum1.inertia" are a body's mass, centre and inertia, in place of its parts.
    circumstances : sequence of str, optional
        What else is to be found of each log: "world.yaw", "world.origin", "position.marker",
        "gyro.bias", "accelerometer.place", "commands.delay", "attitude.clock", "frame_angle.zero"
        and their like.
    noise : mapping of str to float, optional
        The noise of sensors, one standard deviation in their units. Without it, it is estimated
        from the readings.
    loss : str, default "linear"
        The loss of scipy's least squares: "linear", "soft_l1", "huber", "cauchy" or "arctan".
        Another than the default bears with outliers.
    hold_out : int, optional
        The number of a log that is not fitted, but explained by the fit of the others.
    run : callable, optional
        Returns the motion of a scene at times. The default integrates the equations.
    minimize : callable, optional
        Called as scipy's `least_squares`, which is the default.
    progress : callable, optional
        Called with the part of the logs that is fitted and χ² over the degrees of freedom.

    Returns
    -------
    Fit
        The fitted scene, its numbers with their standard deviations, and how well it explains each
        sensor.

    Raises
    ------
    InputError
        If a name is unknown, a log shows too little, or the scene has no motion to begin with.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.integrate("pendulum_robot", 2.0).save("run.csv")
    >>> noise = {"position": 1e-3, "attitude": 1e-2, "gyro": 2e-2, "frame_angle": 1e-2}
    >>> noise.update(frame_rate=2e-2, frame_torque=1e-2)
    >>> found = rb.fit("pendulum_robot", "run.csv", ["frame.kv"], noise=noise)
    >>> print(f"{found.found[0].value:.3f}")
    0.400
    """
    if loss not in LOSSES:
        raise unknown("loss", loss, LOSSES)
    numbers = numbers_of(scene).with_whole(
        [name.removesuffix(WHOLE) for name in free if name.endswith(WHOLE)]
    )
    began = numbers.scene({})
    logs = logs_of(logs, began)
    names = {each.name for log in logs for each in log.sensors}
    for name in noise or {}:
        if name not in names:
            raise unknown("sensor of the logs", name, sorted(names))
    own = of_scene(numbers, free, began.ball.radius)
    solve = partial(
        _solved, numbers, circumstances=circumstances, run=run or by_equations, loss=loss,
        minimize=minimize or least_squares,
    )  # fmt: skip
    sensed = [_sensed(began, log, noise or {}) for log in logs]
    fitted = [each for k, each in enumerate(sensed) if k != hold_out]
    if not fitted:
        raise InputError("a fit needs a log")
    x, residuals, J, complete = solve(own, fitted, progress=progress)
    left = residuals(x)
    freed, covariance, untold = found_at(residuals, x, J)
    found = tuple(freed[: len(own)])
    sensors = [*sensor_fits(residuals, x, len(x) / len(left))]
    held_out: list[SensorFit] = []
    if hold_out is not None:
        # Of it, its start alone is found.
        fixed = {each.name: each.value for each in found}
        y, others, *_ = solve([], [sensed[hold_out]], fixed=fixed)
        held_out = [*sensor_fits(others, y, len(y) / len(others(y)))]
    fitted_scene = residuals.scene(0, residuals.values(x))
    block = covariance[: len(own), : len(own)]
    scale = np.sqrt(np.diag(block))
    # An unknown of a start that changes nothing is none.
    shared = np.array([each.log is None for each in residuals.unknowns])
    felt = shared | (np.linalg.norm(J, axis=0) > 0)
    chi2, degrees = chi2_of(left), max(len(left) - int(felt.sum()), 1)
    probability = partial(
        probability_of,
        degrees=degrees,
        count=len(left),
        estimated=any(flag for each in fitted for flag in each.estimated),
    )
    return Fit(
        scene=fitted_scene,
        text=numbers.text({each.name: each.value for each in found}, fitted_scene),
        found=found,
        of_logs=tuple(freed[len(own) :]),
        correlations=block / np.outer(scale, scale),
        chi2=chi2,
        degrees=degrees,
        probability=probability(chi2),
        sensors=tuple(sensors),
        held_out=tuple(held_out),
        undetermined=tuple(untold),
        contradictions=tuple(contradicting(logs, strays([*sensors, *held_out]))),
        at_limits=tuple(at_limits(residuals, x)),
        influences=tuple(influences(residuals, x, J, found, probability)),
        complete=complete,
    )


def _sensed(scene: Scene, log: Log, noise: Mapping[str, float]) -> FittedLog:
    """Return a log with its sensors' noise, and the start that its first readings show."""
    sizes, first = [], {}
    for sensor in log.sensors:
        first[sensor.name] = np.median(sensor.values[:FIRST], axis=0)
        least = _SMALLEST * float(np.abs(sensor.values).max())
        estimate = max(noise_of(sensor), least)
        given = noise.get(sensor.name)
        if given is not None:
            check_positive(f"the noise of {sensor.name}", given)
        # Over a smaller noise residuals would be too large for their squares.
        dead = np.ptp(sensor.values, axis=0).max() < 1 / LARGEST
        few = len(sensor.times) < FEWEST
        if given is None and (few or dead):
            what = "reads the same all the time" if dead else f"has {len(sensor.times)} readings"
            raise InputError(
                f"{log.name}: {sensor.name} {what}, which does not tell its noise; leave its "
                "columns out, or give its noise"
            )
        sizes.append(estimate if given is None else max(given, least))
    moved = [each.name for each in scene.hinges if each.motor is not None]
    begins = {
        kind: {n: float(first[f"{n}_{kind}"][0]) for n in moved if f"{n}_{kind}" in first}
        for kind in ("angle", "rate")
    }
    started = scene.with_hinges(**begins)
    # One reading, as the median of quaternions is none.
    seen = (each.values[0] for each in log.sensors if each.name == "attitude")
    attitude = next(seen, scene.start.attitude)
    omega = first.get("gyro", scene.angular_velocity_at(scene.start))
    started = replace(started, start=Start(attitude, np.zeros(3)))
    started = replace(started, start=Start(attitude, started.momentum_of(omega)))
    estimated = tuple(sensor.name not in noise for sensor in log.sensors)
    return FittedLog(log, tuple(sizes), estimated, started)


def _solved(
    numbers: Numbers,
    own: Sequence[Unknown],
    logs: Sequence[FittedLog],
    circumstances: Sequence[str],
    run: Run,
    loss: str,
    minimize: Callable[..., Any],
    progress: Callable[[float, float], None] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> tuple[Array, Residuals, Array, bool]:
    """Return the unknowns that fit logs best, the residuals' function and their derivative there.

    The last is whether χ² has come to its minimum. In a narrow valley, differences to one side
    feign a slope along it that is as large as the one that tells the numbers apart: the last step,
    and the derivative, are those of central ones.
    """
    unknowns = list(own)
    for k, each in enumerate(logs):
        unknowns += of_log(each.start, each.log, k, circumstances)
    x, shared = np.zeros(len(unknowns)), np.array([u.log is None for u in unknowns])
    low, high = (
        np.array([(getattr(u, side) - u.value) / u.size for u in unknowns])
        for side in ("low", "high")
    )
    for part in _PARTS:
        residuals = Residuals(
            numbers, unknowns, [e.until(part) for e in logs], run, loss, fixed or {}
        )
        if not np.isfinite(residuals(x)).all():
            x = np.zeros(len(x))  # a shorter part may lead to where the motion soon ends
        if not np.isfinite(first := residuals(x)).all():
            _raise_cause(residuals, x, run)
        # A part of the logs may tell little of an unknown, which must not go astray on it.
        prior = np.where(shared, 1 / _PRIOR if part < 1 else NO_EVIDENCE, _HARDLY)
        with_prior = partial(_with_prior, residuals=residuals, prior=prior)
        # A trial may lead to where no body is.
        with np.errstate(over="ignore", invalid="ignore"):
            x = minimize(
                with_prior, x, partial(_its_jacobian, residuals=residuals, prior=prior),
                (low, high), ftol=_NO_GAIN / len(first) if part == 1 else _ROUGHLY,
                max_nfev=_MOST_TRIALS,
            ).x  # fmt: skip
        if progress is not None:
            progress(part, chi2_of(with_prior(x)) / len(first))
    for _ in range(_LAST_STEPS):
        J, left = residuals.jacobian(x, central=True), with_prior(x)
        step = -np.linalg.lstsq(np.concatenate([J, np.diag(prior)]), left)[0]
        ends = [np.clip(x + part * step, low, high) for part in _FRACTIONS]
        nearest = min(ends, key=lambda end: chi2_of(with_prior(end)))
        if (gain := chi2_of(left) - chi2_of(with_prior(nearest))) > 0:
            x = nearest
        # Not by what the step promises: rounding in J feigns a slope along a narrow valley.
        if gain < _SHORT:
            break
    return x, residuals, J, gain < _SHORT


def _with_prior(x: Array, residuals: Residuals, prior: Array) -> Array:
    return np.concatenate([residuals(x), prior * x])


def _its_jacobian(x: Array, residuals: Residuals, prior: Array) -> Array:
    return np.concatenate([residuals.jacobian(x), np.diag(prior)])


def _raise_cause(residuals: Residuals, x: Array, run: Run) -> None:
    """Raise InputError: why the scene has no motion to begin with."""
    values = residuals.values(x)
    for k, each in enumerate(residuals.logs):
        times = np.array([0.0, each.log.end])
        with named(each.log.name):
            scene = residuals.scene(k, values)
            try:
                motion = run(scene, times)
            except InputError as error:
                # Raises the scene's own error if its own start has no motion either.
                own = residuals.numbers.scene({})
                moved = [hinge for hinge in own.hinges if hinge.motor is not None]
                angles, rates = ({h.name: getattr(h, n) for h in moved} for n in ("angle", "rate"))
                run(replace(scene, start=own.start).with_hinges(angle=angles, rate=rates), times)
                cause, *_ = str(error).split(";")  # without its remedy
                raise InputError(
                    "the log does not fit this robot: from the start that its first readings "
                    f"show, {cause}; check the sensors' units, axes and noise"
                ) from error
            if len(motion.times) < 2:
                raise InputError(f"the motion of {scene.name} ends before the log")
    raise InputError(f"{scene.name} has no motion over the whole of the logs to begin with")
