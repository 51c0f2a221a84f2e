"""What logs tell of the numbers that a fit found, and how well its motions explain them.

A number's deviation is that of the linearised residuals, which is held against χ² itself where it
is large. What the logs cannot tell are the directions in which the unknowns may go far.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.linalg import qr

from robotball.fit.logs import Log
from robotball.fit.residuals import Residuals, Unknown, of_circumstance
from robotball.fit.sensing import circumstances_of, contradictions, stands_still
from robotball.robot.ball import Value
from robotball.rotations import Array

NO_EVIDENCE = 1e-3  # per size: a derivative that rounding may have made
_DOUBT = 1e-3  # a probability below which chance is no explanation
_UNKNOWN = 0.5  # of an unknown's size: a standard deviation that tells nothing
_CURVED = 0.02  # of an unknown's size: a deviation within which a model may be far from linear
_FAR, _RISE = 3.0, 4.0  # deviations, and by how much χ² must rise within them
_AT_LIMIT = 1e-3  # of an unknown's size, from its limit
_SHARE = 0.15  # of the largest part in a direction, below which an unknown has no part in it
_SHOWN = 3.5  # deviations from 0, from which a log shows a circumstance that was not freed
_EXCLUDED = 2.0  # deviations beyond the best amount, from which a log excludes a larger one
_SLIGHT = 0.01  # of a plausible amount, below which the readings exclude enough of it
_WINDOWS = 20  # of a log, in which it is looked for the first that the model does not explain
# Of n readings, as good as so many that are independent, is their noise known by itself.
_NOISE_KNOWN_BY = 0.2


@dataclass(frozen=True)
class Found:
    """Hold one number that a fit has found.

    Attributes
    ----------
    name : str
        The path of the number in the scene file, or the log's name and what it is of its log.
    value, deviation : float
        The value and its standard deviation.
    began : float
        The value from which the fit began.
    unit : str
        The unit of the three.
    determined : bool
        Whether the logs tell it at all.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", 2.0)
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> found = rb.fit("pendulum_robot", [log], ["frame.kv"], noise={"gyro": 0.02})
    >>> found.found[0].name, found.found[0].determined
    ('frame.kv', True)
    """

    name: str
    value: float
    deviation: float
    began: float
    unit: str
    determined: bool


@dataclass(frozen=True)
class SensorFit(Value):
    """Hold how well a fit explains one sensor of a log.

    Attributes
    ----------
    log, name : str
        The names of the log and of the sensor.
    noise : float
        One standard deviation of a reading, as it was given or as the readings show it.
    residual : float
        The root mean square of the residuals, in the unit of the readings.
    probability : float
        How probable residuals at least so large are, if the model is right.
    since : float or None
        The time from which on the model does not explain the readings [s]. None if it does.
    times : (n,), s
        The times of the readings.
    residuals : (n, k)
        The readings less those of the motion; of an attitude the turns [rad].

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", 2.0)
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> found = rb.fit("pendulum_robot", [log], ["frame.kv"], noise={"gyro": 0.02})
    >>> found.sensors[0].name, found.sensors[0].since
    ('gyro', None)
    """

    log: str
    name: str
    noise: float
    residual: float
    probability: float
    since: float | None
    times: Array
    residuals: Array


def strays(sensors: Sequence[SensorFit]) -> list[SensorFit]:
    """Return the sensors whose readings the model does not explain, the worst first."""
    least = _DOUBT / len(sensors)
    return sorted((s for s in sensors if s.probability < least), key=lambda s: s.probability)


def found_at(residuals: Residuals, x: Array, J: Array) -> tuple[list[Found], Array, list[str]]:
    """Return the numbers that a user freed, their covariance in their sizes, and what is not told.

    x, J: where the fit ended (p,), and the derivative of the residuals there (n, p).
    """
    ended = residuals.ended(residuals.values(x))
    slopes = residuals.slopes(x, ended)
    covariance = _widened(slopes @ _covariance(J) @ slopes.T, slopes, x, residuals, ended)
    freed = [i for i, each in enumerate(ended) if not each.of_start]
    covariance, unknowns = covariance[np.ix_(freed, freed)], [ended[i] for i in freed]
    names = [e.log.name for e in residuals.logs if stands_still({s.name: s for s in e.log.sensors})]
    # Of a robot that stands still what seems told is noise times noise, such as a gain times the
    # rate at which the fit lets the motor start.
    still = len(names) == len(residuals.logs)
    found = [
        Found(
            last.full_name, last.value, deviation * last.size, residuals.unknowns[i].value,
            last.unit, deviation < _UNKNOWN and not (still and last.log is None),
        )
        for i, last, deviation in zip(
            freed, unknowns, np.sqrt(np.diag(covariance)).tolist(), strict=True
        )
    ]  # fmt: skip
    untold = [f"{name}: {_STILL}" for name in names]
    return found, covariance, [*untold, *_undetermined(covariance, unknowns)]


_STILL = (
    "its sensors read the same all the time, but for noise; a robot that stands still tells "
    "nothing of its motion"
)


def _covariance(J: Array) -> Array:
    """Return the covariance (p, p) of unknowns in their sizes, finite where nothing is known."""
    _, singular, axes = np.linalg.svd(J, full_matrices=False)
    return np.asarray((axes.T / np.hypot(singular, NO_EVIDENCE) ** 2) @ axes)


def _widened(
    covariance: Array, slopes: Array, x: Array, residuals: Residuals, ended: Sequence[Unknown]
) -> Array:
    """Return the covariance (p, p) with deviations that χ² itself has, by refits of the others.

    A gain times a starting rate may be found of noise alone, and the gain as exactly as the noise
    makes the rate large. But without that rate, any gain explains the logs nearly as well, and χ²
    soon rises no more: a deviation is doubled until three of it, away from 0, where χ² is flatter,
    raise χ² by 4.

    slopes: (p, p), the derivative of the values by x, in the values' sizes.
    """
    scale, squares = np.ones(len(x)), chi2_of(residuals(x))
    for i, each in enumerate(ended):
        deviation = float(np.sqrt(covariance[i, i]))
        if each.of_start or deviation < _CURVED:
            continue
        far = np.copysign(_FAR, each.value) * np.linalg.solve(slopes, covariance[i]) / deviation
        hold = slopes[i] / (NO_EVIDENCE * deviation)
        while scale[i] * deviation < _UNKNOWN and (
            _refitted(x + scale[i] * far, hold, residuals) < squares + _RISE
        ):
            scale[i] *= 2
    return scale[:, None] * covariance * scale


@np.errstate(over="ignore", invalid="ignore")  # a step may lead to where no body is
def _refitted(x: Array, hold: Array, residuals: Residuals) -> float:
    """Return χ² after a step to the best x of which hold · x is the same; inf for no motion."""
    left = residuals(x)
    if not np.isfinite(before := chi2_of(left)):
        return before
    J = np.concatenate([residuals.jacobian(x), [hold], NO_EVIDENCE * np.eye(len(x))])
    step = np.linalg.lstsq(J, np.concatenate([left, np.zeros(1 + len(x))]))[0]
    return min(before, chi2_of(residuals(x - step)))


def at_limits(residuals: Residuals, x: Array) -> Iterator[str]:
    """Yield a line for each number of the scene that ended at a limit: none beyond was tried."""
    for each in residuals.ended(residuals.values(x)):
        for limit in (each.low, each.high):
            if each.log is None and abs(each.value - limit) < _AT_LIMIT * each.size:
                shown = limit if abs(limit) > _AT_LIMIT * each.size else 0.0
                what = f"ended at its limit of {shown:.3g}: the logs would have it beyond"
                yield f"{each.name} {what}"


def influences(
    residuals: Residuals,
    x: Array,
    J: Array,
    found: Sequence[Found],
    probability: Callable[[float], float],
) -> Iterator[str]:
    """Yield a line for each circumstance that was not freed and may have moved a number.

    Each is added alone to the linearised fit, which gives its amount, the deviation of that, and
    how far it moves the numbers. A line is due if an amount that is plausible, and that the
    readings do not exclude, moves a number by more than its deviation. If the fit does not explain
    the logs, a line is due only for a circumstance with which it would.

    x, J: as of `found_at`; found: the numbers of the scene; probability: that of χ².
    """
    names, plausible, others = zip(*_not_freed(residuals), strict=True)
    columns, left = residuals.of_others(x, others), residuals(x)
    ended = residuals.ended(residuals.values(x))
    slope = np.concatenate([J, NO_EVIDENCE * np.eye(len(x))])
    steps = -np.linalg.lstsq(slope, np.concatenate([columns, np.zeros((len(x), len(others)))]))[0]
    sizes = np.array([[each.size] for each in ended])
    moved = (sizes * (residuals.slopes(x, ended) @ steps))[: len(found)]  # per size of the others
    explained, squares = probability(chi2_of(left)) > _DOUBT, chi2_of(left)
    worst: dict[str, tuple[float, str]] = {}
    for i, column in enumerate((columns + J @ steps).T):
        deviation = 1 / max(float(np.linalg.norm(column)), NO_EVIDENCE)
        amount = max(-float(column @ left) * deviation**2, others[i].low)
        shown = abs(amount) > _SHOWN * deviation
        reach = min(plausible[i] / others[i].size, abs(amount) + _EXCLUDED * deviation)
        change = (amount if shown else reach) * moved[:, i]
        ratios = [
            abs(by) / each.deviation if each.determined else 0.0
            for by, each in zip(change.tolist(), found, strict=True)
        ]
        j = int(np.argmax(ratios))
        slight = not shown and reach < _SLIGHT * plausible[i] / others[i].size
        helps = explained or probability(squares - (amount / deviation) ** 2) > _DOUBT
        if ratios[j] < 1 or slight or not helps:
            continue
        factor, unit = (100.0, "%") if others[i].unit == "1" else (1.0, others[i].unit)
        factor *= others[i].size
        what = (
            f"seems to be {factor * amount:.2g} ± {factor * deviation:.2g} {unit}, not 0, with "
            f"which {found[j].name} is {found[j].value + change[j]:.4g}"
            if shown
            else f"is taken as 0, but may be {factor * reach:.2g} {unit}, which moves "
            f"{found[j].name} by {abs(change[j]):.2g}"
        )
        line = (
            f"{others[i].full_name} {what}, {ratios[j]:.2g} times its ±: "
            f"{'' if shown else 'measure it, or '}add --also {names[i]}"
        )
        circumstance = others[i].of + names[i]
        worst[circumstance] = max(worst.get(circumstance, (0.0, "")), (ratios[j], line))
    yield from (line for _, line in sorted(worst.values(), reverse=True))


def _not_freed(residuals: Residuals) -> Iterator[tuple[str, float, Unknown]]:
    """Yield the unknowns of circumstances that were not freed, with name and plausible amount."""
    values = np.array([each.value for each in residuals.unknowns])
    for k, fitted in enumerate(residuals.logs):
        freed, log = residuals.given(k, values), fitted.log
        alone = f"{log.sensors[0].name}.clock" if len(log.sensors) == 1 else ""
        for name, known in circumstances_of([each.name for each in log.sensors]).items():
            of_commands = name == "commands.delay" and not log.commands
            if name in freed or name == alone or of_commands:
                continue
            for unknown in of_circumstance(fitted.start, log, k, name):
                yield name, known.plausible, unknown


def _undetermined(covariance: Array, unknowns: Sequence[Unknown]) -> Iterator[str]:
    """Yield what the logs cannot tell, by the directions in which the unknowns may go."""
    variances, axes = np.linalg.eigh(covariance)
    for direction in _sparse(axes[:, variances > _UNKNOWN**2].T):
        parts = [i for i in range(len(unknowns)) if abs(direction[i]) > _SHARE]
        names = [unknowns[i].full_name for i in parts]
        if len(parts) == 1:
            yield f"{names[0]} is not determined: half of its size would not show above the noise"
            continue
        ratio = direction[parts[1]] / direction[parts[0]]
        relative = all(unknowns[i].size == abs(unknowns[i].value) for i in parts)
        if len(parts) == 2 and relative and abs(abs(ratio) - 1) < _SHARE:
            sign = "×" if ratio < 0 else "/"
            yield f"only {names[0]} {sign} {names[1]} is determined"
            continue
        changes = ", ".join(
            f"{direction[i] * unknowns[i].size / max(abs(direction)) / 10:+.3g} {unknowns[i].unit} "
            f"of {name}"
            for i, name in zip(parts, names, strict=True)
        )
        yield f"not determined apart: {changes}, together, change nothing that was measured"


def _sparse(directions: Array) -> Array:
    """Return a basis (m, p) of the same space, in which each direction has a part of its own."""
    own = qr(directions, mode="r", pivoting=True)[1][: len(directions)]
    return np.asarray(np.linalg.solve(directions[:, own], directions))


def chi2_of(left: Array) -> float:
    """Return χ² of residuals over their noise."""
    return float((left**2).sum())


def probability_of(chi2: float, degrees: float, count: int, estimated: bool) -> float:
    """Return how probable a χ² at least as large is; noise that is estimated is uncertain too."""
    if estimated:
        return float(stats.f.sf(chi2 / degrees, degrees, _NOISE_KNOWN_BY * count))
    return float(stats.chi2.sf(chi2, degrees))


def sensor_fits(residuals: Residuals, x: Array, fitted: float) -> Iterator[SensorFit]:
    """Yield how well each sensor is explained; fitted: unknowns per reading."""
    for k, sensed in enumerate(residuals.logs):
        found = residuals.of_log(k, x)
        assert found is not None  # the fit ended in a motion
        for sensor, noise, estimated, left in zip(
            sensed.log.sensors, sensed.noise, sensed.estimated, found, strict=True
        ):
            degrees = max(left.size * (1 - fitted), 1.0)
            chi2 = chi2_of(residuals.counted(left / noise))
            probability = probability_of(chi2, degrees, left.size, estimated)
            yield SensorFit(
                sensed.log.name, sensor.name, noise, float(np.sqrt((left**2).mean())), probability,
                _since(sensor.times, left / noise) if probability < _DOUBT else None,
                sensor.times, left,
            )  # fmt: skip


def _since(times: Array, weighed: Array) -> float:
    """Return the time from which on readings are not explained [s]."""
    for rows in np.array_split(np.arange(len(times)), min(_WINDOWS, len(times))):
        part = weighed[rows]
        if stats.chi2.sf(chi2_of(part), part.size) < _DOUBT / _WINDOWS:
            return float(times[rows[0]])
    return float(times[0])


def contradicting(logs: Sequence[Log], astray: Sequence[SensorFit]) -> Iterator[str]:
    """Yield a line for two sensors of a log of which one strays and that contradict each other."""
    names = {(each.log, each.name) for each in astray}
    for log in logs:
        for pair in contradictions({each.name: each for each in log.sensors}):
            if names & {(log.name, name) for name in pair}:
                yield (
                    f"{pair[0]} and {pair[1]} of {log.name} contradict each other, whatever the "
                    "model: check signs, units and axes, and the quaternion's order"
                )
