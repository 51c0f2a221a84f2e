"""Uncertainty of fitted numbers, and how well the fitted motions explain the logs.

Standard deviations come from the linearised residuals; large standard deviations are checked
against χ² itself. Undetermined combinations are the directions in which the unknowns can move far.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtrc, fdtrc  # scipy.stats takes a quarter second to import

from robotball.fit.logs import Log
from robotball.fit.residuals import ADDED, Change, Residuals, Unknown, of_circumstance
from robotball.fit.sensing import circumstances_of, contradictions, stands_still
from robotball.robot.ball import Value
from robotball.robot.motors import Actuator, Law
from robotball.robot.scene import Scene
from robotball.rotations import Array

NO_EVIDENCE = 1e-3  # per unknown's size: a smaller derivative may be rounding
_DOUBT = 1e-3  # probability below which chance is not accepted as an explanation
_UNKNOWN = 0.5  # of an unknown's size: standard deviation above which it is not determined
_CURVED = 0.02  # of an unknown's size: deviation above which nonlinearity is checked
_FAR, _RISE = 3.0, 4.0  # deviations, and the rise of χ² that is required within them
_UNLIMITED = 100.0  # of its size: increase of a friction, so that no motion reaches it
_AT_LIMIT = 1e-3  # of an unknown's size: distance that counts as being at a limit
_MOVES = 0.01  # of an unknown's size: change by the next step that is reported
# Number of reasons that are fitted, trials of each reason, and ftol of a trial. With an ftol of
# 1e-2 rounding decides the result.
_TRIED, _TRIALS, _GAIN = 5, 30, 1e-4
_LARGEST = 100.0  # of a plausible amount: largest amount that is a reason
_REMAINS = 0.1  # of χ² above its mean: largest part that a reason may leave
_PROMISES = 0.5  # the same for the linearised fit
_SHARE = 0.15  # of a direction's largest component: smaller components are ignored
SHOWN = 3.5  # deviations from 0 above which the readings show a circumstance
_EXCLUDED = 2.0  # deviations above the best amount that the readings do not exclude
_SLIGHT = 0.01  # of a plausible amount: a smaller possible amount is not reported
_WINDOWS = 20  # parts of a log, among which the first unexplained one is sought
_NOISE_KNOWN_BY = 0.2  # independent readings per reading, for a noise estimated from the readings
_STILL = "its readings are constant except for noise: a robot at rest does not constrain its motion"


@dataclass(frozen=True)
class Estimate:
    """Hold a number that was fitted.

    Attributes
    ----------
    name : str
        The path of the number in the scene file, or the names of the log and of the circumstance.
    value, deviation : float
        The value and its standard deviation.
    began : float
        The initial value of the fit.
    unit : str
        The unit of the value, the deviation and the initial value.
    determined : bool
        Whether the logs constrain the number.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", 2.0)
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> result = rb.fit("pendulum_robot", [log], ["frame.kv"], noise={"gyro": 0.02})
    >>> result.found[0].name, result.found[0].determined
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
    """Report how well a fit explains one sensor of a log.

    Attributes
    ----------
    log, name : str
        The names of the log and of the sensor.
    noise : float
        The standard deviation of a reading, as specified or as estimated from the readings.
    residual : float
        The root mean square of the residuals, in the unit of the readings.
    probability : float
        The probability of residuals at least as large, if the model is right.
    since : float or None, s
        The time from which the model fails to explain the readings. None if it explains them.
    times : (n,), s
        The times of the readings.
    residuals : (n, k)
        Readings minus model; rotation vectors for an attitude [rad].
    readings : (n, k)
        The readings; quaternions for an attitude.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", 2.0)
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> result = rb.fit("pendulum_robot", [log], ["frame.kv"], noise={"gyro": 0.02})
    >>> result.sensors[0].name, result.sensors[0].since
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
    readings: Array


def strays(sensors: Sequence[SensorFit]) -> list[SensorFit]:
    """Return the sensors that the model fails to explain, the worst first."""
    least = _DOUBT / len(sensors)
    return sorted((s for s in sensors if s.probability < least), key=lambda s: s.probability)


def estimates_at(
    residuals: Residuals, x: Array, J: Array, complete: bool
) -> tuple[list[Estimate], Array, list[str]]:
    """Return the estimates, their covariance in units of their sizes, and undetermined unknowns.

    x (p,), J (n, p): the solution and the derivative of the residuals there; complete: whether x is
    a minimum of χ².
    """
    ended = residuals.ended(residuals.values(x))
    slopes = residuals.slopes(x, ended)
    covariance = slopes @ _covariance(J) @ slopes.T
    if complete:
        covariance = _widened(covariance, slopes, x, residuals, ended)
    freed = [i for i, unknown in enumerate(ended) if not unknown.of_start]
    covariance, unknowns = covariance[np.ix_(freed, freed)], [ended[i] for i in freed]
    names = [e.log.name for e in residuals.logs if stands_still({s.name: s for s in e.log.sensors})]
    # At rest any apparent evidence is a product of noise, such as a gain times a fitted start rate.
    still = len(names) == len(residuals.logs)
    estimates = []
    for i, unknown, deviation in zip(freed, unknowns, np.sqrt(np.diag(covariance)), strict=True):
        value, began = unknown.value, residuals.unknowns[i].value
        determined = bool(deviation < _UNKNOWN) and not (still and unknown.log is None)
        spread = float(deviation) * unknown.size
        numbers = value, spread, began, unknown.unit, determined
        estimates.append(Estimate(unknown.full_name, *numbers))
    undetermined = [f"{name}: {_STILL}" for name in names]
    undetermined += _undetermined(covariance, unknowns)
    undetermined += [
        f"{ended[i].name} is at least about {need:.3g}, which is the most that the motions need"
        for i, need in residuals.needs(x, sticking=True).items()
        if not estimates[freed.index(i)].determined
    ]
    return estimates, covariance, undetermined


def _covariance(J: Array) -> Array:
    """Return the covariance (p, p) in units of the sizes, finite even without evidence."""
    _, singular, axes = np.linalg.svd(J, full_matrices=False)
    return np.asarray((axes.T / np.hypot(singular, NO_EVIDENCE) ** 2) @ axes)


def _widened(
    covariance: Array, slopes: Array, x: Array, residuals: Residuals, ended: Sequence[Unknown]
) -> Array:
    """Return the covariance (p, p) with deviations enlarged until χ² itself confirms them.

    A product, such as a gain times a start rate, may be fitted to pure noise. If noise makes the
    start rate large, the product seems to constrain the gain. With a start rate of 0, however, any
    gain explains the logs almost as well, so χ² soon stops rising as the gain changes. A deviation
    is therefore doubled until a change of three deviations raises χ² by 4. The change is away from
    0, because χ² is flatter there.

    slopes (p, p): derivative of the values by x, in units of the values' sizes.
    """
    scale, squares = np.ones(len(x)), chi2_of(residuals(x))
    for i, unknown in enumerate(ended):
        deviation = float(np.sqrt(covariance[i, i]))
        hold = slopes[i] / (NO_EVIDENCE * deviation)
        if unknown.of_friction:
            # A motion that hardly slips may as well roll.
            rolling = x + _UNLIMITED * (np.arange(len(x)) == i)
            if _refitted(rolling, hold, residuals) < squares + _RISE:
                scale[i] = max(2 * _UNKNOWN / deviation, 1.0)
        if unknown.of_start or unknown.of_friction or deviation < _CURVED:
            continue
        along = np.linalg.lstsq(slopes, covariance[i])[0]
        far = np.copysign(_FAR, unknown.value) * along / deviation
        while scale[i] * deviation < _UNKNOWN and (
            _refitted(x + scale[i] * far, hold, residuals) < squares + _RISE
        ):
            scale[i] *= 2
    return scale[:, None] * covariance * scale


@np.errstate(over="ignore", invalid="ignore")  # a step may lead to an impossible body
def _refitted(x: Array, hold: Array, residuals: Residuals) -> float:
    """Return χ² after one step that minimises it at constant hold · x; inf without a motion."""
    left = residuals(x)
    if not np.isfinite(before := chi2_of(left)):
        return before
    J = np.concatenate([residuals.jacobian(x), [hold], NO_EVIDENCE * np.eye(len(x))])
    step = np.linalg.lstsq(J, np.concatenate([left, np.zeros(1 + len(x))]))[0]
    return min(before, chi2_of(residuals(x - step)))


@np.errstate(over="ignore", invalid="ignore")  # a step may lead to an impossible body
def moving(residuals: Residuals, x: Array, J: Array) -> Iterator[str]:
    """Yield a line for each number that the next step of an unfinished fit would change."""
    slope = np.concatenate([J, NO_EVIDENCE * np.eye(len(x))])
    step = -np.linalg.lstsq(slope, np.concatenate([residuals(x), np.zeros(len(x))]))[0]
    here, there = residuals.values(x), residuals.values(x + step)
    for unknown, value, after in zip(residuals.unknowns, here, there, strict=True):
        if not unknown.of_start and abs(after - value) > _MOVES * unknown.size:
            yield (
                f"{unknown.full_name} is still moving: it is {value:.4g} {unknown.unit}, and the "
                f"next step leads to {min(max(after, unknown.low), unknown.high):.4g}"
            )


def at_limits(residuals: Residuals, x: Array, explains: bool) -> Iterator[str]:
    """Yield a line for each number of the scene that ended at one of its limits."""
    means = ", and the model explains the log" if explains else ": a value beyond fits better"
    for unknown in residuals.ended(residuals.values(x)):
        for limit in (unknown.low, unknown.high):
            if unknown.log is None and abs(unknown.value - limit) < _AT_LIMIT * unknown.size:
                shown = limit if abs(limit) > _AT_LIMIT * unknown.size else 0.0
                yield f"{unknown.name} ended at its limit {shown:.3g}{means}"


def influences(
    residuals: Residuals, x: Array, J: Array, estimates: Sequence[Estimate]
) -> Iterator[str]:
    """Yield a line for each circumstance that was not freed and may have biased an estimate.

    Each circumstance is added separately to the linearised fit. This gives the amount of the
    circumstance, its deviation, and the change of each estimate. A circumstance is reported if a
    plausible amount that the readings do not exclude changes an estimate by more than the
    estimate's deviation.

    x, J: as in `estimates_at`; estimates: of the scene's numbers.
    """
    names, plausible, others = zip(*_not_freed(residuals), strict=True)
    columns, left = residuals.of_others(x, others), residuals(x)
    ended = residuals.ended(residuals.values(x))
    slope = np.concatenate([J, NO_EVIDENCE * np.eye(len(x))])
    steps = -np.linalg.lstsq(slope, np.concatenate([columns, np.zeros((len(x), len(others)))]))[0]
    sizes = np.array([[unknown.size] for unknown in ended])
    moved = (sizes * (residuals.slopes(x, ended) @ steps))[: len(estimates)]  # per size
    worst: dict[str, tuple[float, str]] = {}
    for i, column in enumerate((columns + J @ steps).T):
        deviation = 1 / max(float(np.linalg.norm(column)), NO_EVIDENCE)
        amount = max(-float(column @ left) * deviation**2, others[i].low)
        shown = abs(amount) > SHOWN * deviation
        reach = min(plausible[i] / others[i].size, abs(amount) + _EXCLUDED * deviation)
        change = (amount if shown else reach) * moved[:, i]
        ratios = [
            abs(by) / estimate.deviation if estimate.determined else 0.0
            for by, estimate in zip(change.tolist(), estimates, strict=True)
        ]
        j = int(np.argmax(ratios))
        slight = not shown and reach < _SLIGHT * plausible[i] / others[i].size
        if ratios[j] < 1 or slight:
            continue
        factor, unit = (100.0, "%") if others[i].unit == "1" else (1.0, others[i].unit)
        factor *= others[i].size
        if shown:
            finding = (
                f"seems to be {factor * amount:.2g} ± {factor * deviation:.2g} {unit}, not 0; this "
                f"changes {estimates[j].name} to {estimates[j].value + change[j]:.4g}"
            )
        else:
            finding = (
                f"is assumed 0, but may be {factor * reach:.2g} {unit}, which changes "
                f"{estimates[j].name} by {abs(change[j]):.2g}"
            )
        line = (
            f"{others[i].full_name} {finding}, {ratios[j]:.2g} times its ±: "
            f"{'' if shown else 'measure it, or '}add --also {names[i]}"
        )
        circumstance = others[i].of + names[i]
        worst[circumstance] = max(worst.get(circumstance, (0.0, "")), (ratios[j], line))
    yield from (line for _, line in sorted(worst.values(), reverse=True))


def reason(residuals: Residuals, x: Array, J: Array, stray: SensorFit) -> str:
    """Return the most probable reason why a fit does not explain its logs.

    The amounts of each candidate are added to the linearised fit (Rao's score test). The candidates
    that promise the least χ² are then fitted, until one explains the logs. stray: the least
    explained sensor.
    """
    left, slope = residuals(x), np.concatenate([J, NO_EVIDENCE * np.eye(len(x))])
    before, count, tried = chi2_of(left), len(left), []
    for title, others, change, limit in _candidates(residuals):
        columns = residuals.of_others(x, others, change)
        wide = np.concatenate([columns, np.zeros((len(x), len(others)))])
        across = columns - J @ np.linalg.lstsq(slope, wide)[0]
        amounts = np.linalg.lstsq(across, -left, _SLIGHT)[0]
        promised = before + float(left @ across @ amounts) - count
        possible = all(u.low < a * u.size < limit for a, u in zip(amounts, others, strict=True))
        if possible and promised < _PROMISES * (before - count):
            tried.append((promised, title, others, change, amounts))
    for _, title, others, change, amounts in sorted(tried, key=lambda trial: trial[0])[:_TRIED]:
        wider = residuals.with_unknowns(others, change)
        low = np.append(x - np.inf, [u.low / u.size for u in others])
        begins = [np.append(x, part * amounts) for part in (1.0, 0.3, 0.1, 0.03, 0.0)]
        with np.errstate(over="ignore", invalid="ignore"):
            begin = min(begins, key=lambda begin: chi2_of(wider(begin)))
            end = least_squares(
                wider, begin, wider.jacobian, (low, np.inf), ftol=_GAIN, max_nfev=_TRIALS
            )
        shown = ", ".join(f"{value:.2g}" for value in wider.values(end.x)[len(x) :].tolist())
        if found := explained(title.format(shown), before, 2 * float(end.cost), count):
            return found
    world = ", try --also world.origin,world.yaw" if stray.name == "position" else ""
    return (
        "not found: no resistance, rest position or clock explains the logs; check the unit and "
        f"axes of {stray.name}{world}, and free more numbers"
    )


def explained(title: str, before: float, after: float, count: int) -> str:
    """Return a reason with the fall of χ² of `count` readings, if it explains them; else ""."""
    falls = f"χ²/n falls from {before / count:.3g} to {after / count:.3g}"
    return f"{title}; with it {falls}" * (after - count < _REMAINS * (before - count))


def _candidates(residuals: Residuals) -> Iterator[tuple[str, list[Unknown], Change | None, float]]:
    """Yield (title, unknowns, change of the scene, largest amount) of each possible reason."""
    for (log, name), group in groupby(_not_freed(residuals), lambda pair: (pair[2].of, pair[0])):
        _, (plausible, *_), others = zip(*group, strict=True)
        title = f"{log}{name} seems to be {{}} {others[0].unit}, not 0: add --also {name}"
        yield title, [*others], None, _LARGEST * plausible
    scene = residuals.logs[0].start
    size, now = 1e-2 * scene.ball.radius, scene.friction.rolling
    if all(unknown.name != "friction.rolling" for unknown in residuals.unknowns):
        sum_ = f"{now:g} + " if now else ""
        title = (
            f"resistance: friction.rolling seems to be {sum_}{{}} m: add --free friction.rolling"
        )
        yield title, _added(residuals, size, -now), _resisted, np.inf
    torque = size * scene.ball.mass * scene.gravity
    for hinge in (hinge.name for hinge in scene.hinges if hinge.motor is not None):
        for field, low, title in (
            ("friction", 0.0, f"stiction: the scene lacks dry friction of {{}} N m on {hinge}"),
            ("per_rate", 0.0, f"resistance: the scene lacks damping of {{}} N m s/rad on {hinge}"),
            ("at_rest", -np.inf, f"{hinge} rests off zero: the scene lacks a torque of {{}} N m"),
        ):
            change = partial(_loaded, hinge=hinge, field=field)
            yield title, _added(residuals, torque, low), change, np.inf


def _added(residuals: Residuals, size: float, low: float) -> list[Unknown]:
    return [Unknown(ADDED, 0.0, size, "", k, low=low) for k in range(len(residuals.logs))]


def _resisted(scene: Scene, amount: float) -> Scene:
    rolling = max(scene.friction.rolling + amount, 0.0)
    return replace(scene, friction=replace(scene.friction, rolling=rolling))


def _loaded(scene: Scene, amount: float, hinge: str, field: str) -> Scene:
    law = Law(0.0, 0.0, 0.0)._replace(**{field: amount})
    return replace(scene, actuators=(*scene.actuators, Actuator(" load", ((hinge, 1.0),), law)))


def _not_freed(residuals: Residuals) -> Iterator[tuple[str, float, Unknown]]:
    """Yield (name, plausible amount, unknown) of all circumstances that were not freed."""
    values = np.array([unknown.value for unknown in residuals.unknowns])
    for k, fitted in enumerate(residuals.logs):
        freed, log = residuals.log_values(k, values), fitted.log
        alone = f"{log.sensors[0].name}.clock" if len(log.sensors) == 1 else ""
        circumstances = circumstances_of([sensor.name for sensor in log.sensors])
        for name, circumstance in circumstances.items():
            of_commands = name == "commands.delay" and not log.commands
            if name in freed or name == alone or of_commands:
                continue
            for unknown in of_circumstance(fitted, k, name):
                yield name, circumstance.plausible, unknown


def _undetermined(covariance: Array, unknowns: Sequence[Unknown]) -> Iterator[str]:
    variances, axes = np.linalg.eigh(covariance)
    for direction in _sparse(axes[:, variances > _UNKNOWN**2].T):
        parts = [i for i in range(len(unknowns)) if abs(direction[i]) > _SHARE]
        names = [unknowns[i].full_name for i in parts]
        if len(parts) == 1:
            same = "; on a level plane it cannot be told from the start's heading"
            same *= unknowns[parts[0]].name == "world.yaw"
            yield f"{names[0]} is not determined: a change by half its size is within noise{same}"
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
        yield f"not determined separately: {changes}, changed together, leave all readings the same"


def _sparse(directions: Array) -> Array:
    """Return a basis (m, p) of the same space with one nonzero pivot component per direction."""
    from scipy.linalg import qr  # late: most fits determine every number

    pivots = qr(directions, mode="r", pivoting=True)[1][: len(directions)]
    return np.asarray(np.linalg.solve(directions[:, pivots], directions))


def chi2_of(left: Array) -> float:
    """Return χ² of residuals that are divided by their noise."""
    return float((left**2).sum())


def probability_of(chi2: float, degrees: float, count: int, estimated: bool) -> float:
    """Return the probability of a χ² at least as large, allowing for estimated noise."""
    if estimated:
        return float(fdtrc(degrees, _NOISE_KNOWN_BY * count, chi2 / degrees))
    return float(chdtrc(degrees, chi2))


def sensor_fits(residuals: Residuals, x: Array, fitted: float) -> Iterator[SensorFit]:
    """Yield how well each sensor is explained; fitted: number of unknowns per reading."""
    for k, sensed in enumerate(residuals.logs):
        differences = residuals.of_log(k, x)
        assert differences is not None  # the fit ended in a motion
        for sensor, noise, estimated, left in zip(
            sensed.log.sensors, sensed.noise, sensed.estimated, differences, strict=True
        ):
            degrees = max(left.size * (1 - fitted), 1.0)
            chi2 = chi2_of(left / noise)
            probability = probability_of(chi2, degrees, left.size, estimated)
            rms = float(np.sqrt((left**2).mean()))
            since = _since(sensor.times, left / noise) if probability < _DOUBT else None
            names = sensed.log.name, sensor.name
            yield SensorFit(
                *names, noise, rms, probability, since, sensor.times, left, sensor.values
            )


def _since(times: Array, weighed: Array) -> float:
    for rows in np.array_split(np.arange(len(times)), min(_WINDOWS, len(times))):
        part = weighed[rows]
        if chdtrc(part.size, chi2_of(part)) < _DOUBT / _WINDOWS:
            return float(times[rows[0]])
    return float(times[0])


def contradicting(logs: Sequence[Log], astray: Sequence[SensorFit]) -> Iterator[str]:
    """Yield a line for each pair of contradictory sensors of a log, at least one unexplained."""
    names = {(sensor.log, sensor.name) for sensor in astray}
    for log in logs:
        for *pair, axes in contradictions({sensor.name: sensor for sensor in log.sensors}):
            if names & {(log.name, name) for name in pair}:
                remedy = (
                    f"the axes of {pair[0]} seem to be {axes}"
                    if axes
                    else ("check signs, units, axes and the order of the quaternion")
                )
                yield (
                    f"{pair[0]} and {pair[1]} of {log.name} contradict each other with any model: "
                    f"{remedy}"
                )
