"""Fit a scene to logs: which masses, places and gains explain what a robot's sensors read.

The unknowns are numbers of the scene, shared by all logs, and of each log the start of its motion
and such circumstances as a gyro's bias. Residuals are readings less those of the motion, over the
sensor's noise; least squares by scipy, with derivatives by differences. A fit goes from the first
part of a motion to the whole, as a wrong guess is soon out of step with the log.

In order: what is found, the unknowns, the residuals, the steps of a fit, what it says.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from robotball.drives import Constant
from robotball.engine import integrate
from robotball.errors import InputError, SceneWarning, unknown
from robotball.files import named
from robotball.files.logs import Log
from robotball.files.numbers import Numbers
from robotball.files.scene_numbers import numbers_of
from robotball.function_drives import Held
from robotball.motion import Motion
from robotball.rotations import Array, Mask, turned
from robotball.scene import Scene, Start
from robotball.sensing import (
    FEWEST,
    Rows,
    apart,
    circumstance,
    contradictions,
    is_of_readings,
    noise_of,
    stands_still,
    times_of,
)

Run = Callable[[Scene, Array], Motion]
# By scipy's names, what a squared residual counts.
_LOSSES: Mapping[str, Callable[[Array], Array]] = {
    "linear": lambda z: z,
    "soft_l1": lambda z: 2 * (np.sqrt(1 + z) - 1),
    "huber": lambda z: np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
    "cauchy": np.log1p,
    "arctan": np.arctan,
}
_RTOL = 1e-9  # of the equations: over _DIFFERENCE still 1e-5 of what sensors read
_DIFFERENCE = 1e-3  # of an unknown's size, by which residuals are differentiated
# The same, and the tolerance, where the equations move neighbours by the same steps: such motions
# err alike, and the derivative by 1e-4 of itself.
_SMALL, _ROUGH_RTOL = 1e-6, 1e-7
_PARTS = (0.15, 0.4, 1.0)  # of the logs, to which the fit is made in turn
_PRIOR = 1.0  # of an unknown's size: how far a part of the logs may move it without evidence
_DOUBT = 1e-3  # a probability below which chance is no explanation
_UNKNOWN = 0.5  # of an unknown's size: a standard deviation that tells nothing
_CURVED = 0.02  # of an unknown's size: a deviation within which a model may be far from linear
_FAR, _RISE = 3.0, 4.0  # deviations, and by how much χ² must rise within them
_AT_LIMIT = 1e-3  # of an unknown's size, from its limit
_SHARE = 0.15  # of the largest part in a direction, below which an unknown has no part in it
_WINDOWS = 20  # of a log, in which it is looked for the first that the model does not explain
# Of n readings, as good as so many that are independent, is their noise known by itself.
_NOISE_KNOWN_BY = 0.2
_LEAST = 1e-12  # of a positive number, below which it is not sought
_SMALLEST = 1e-7  # of a sensor's readings: what the equations and engines err by is no evidence


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
    >>> motion = rb.integrate("pendulum_robot", rb.sample_times(2.0))
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
class SensorFit:
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
    >>> motion = rb.integrate("pendulum_robot", rb.sample_times(2.0))
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


@dataclass(frozen=True)
class Fit:
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

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> motion = rb.integrate("pendulum_robot", rb.sample_times(2.0))
    >>> gyro = rb.Sensor("gyro", motion.times, motion.angular_velocity)
    >>> log = rb.Log("run", (gyro,), {})
    >>> found = rb.fit("pendulum_robot", [log], ["frame.kv"], noise={"gyro": 0.02})
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
    contradictions: tuple[str, ...] = ()

    @property
    def explains(self) -> bool:
        """Whether the model explains the logs, those held out too."""
        return not self.strays

    @property
    def strays(self) -> tuple[SensorFit, ...]:
        """The sensors whose readings the model does not explain, the worst first."""
        every = (*self.sensors, *self.held_out)
        least = _DOUBT / len(every)
        return tuple(
            sorted((s for s in every if s.probability < least), key=lambda s: s.probability)
        )


@dataclass(frozen=True)
class _Unknown:
    """A number to be found: what it begins with, its size, and its limits.

    log: the number of the log that it belongs to, None where all share it; moves: whether it
    changes the motion, and not the readings alone; whole: whether it is one of the ten of a body's
    inertia, which are sought together.
    """

    name: str
    value: float
    size: float
    unit: str
    log: int | None = None
    moves: bool = True
    low: float = -np.inf
    high: float = np.inf
    whole: bool = False

    @property
    def of_start(self) -> bool:
        """Whether it is of a motion's start, which no user frees."""
        return self.name.startswith("start.")


_POSITIVE = ("mass", "density", "radius", "kv", "kp", "torque_limit", "stall_torque", "gravity",
             "rolling")  # fmt: skip


def _of_scene(numbers: Numbers, free: Sequence[str], radius: float) -> Iterator[_Unknown]:
    """Yield the unknowns of a scene: a path, or a path with limits, as path=low:high."""
    for text in free:
        if text.endswith(_WHOLE):
            yield from _of_body(numbers, text.removesuffix(_WHOLE), radius)
            continue
        name, _, limits = text.partition("=")
        path = numbers.path_of(name.strip())
        value, unit = numbers.value(path), numbers.unit(path)
        last = path.rpartition(".")[2]
        # Not 0 itself, where a motor or a body of a positive number would be none.
        low = _LEAST * value if value >= 0 and last in _POSITIVE else -np.inf
        high = np.inf
        if limits:
            low, high = _limits(text, limits)
            if not low <= value <= high:
                raise InputError(f"{path} begins at {value:g}, outside {limits}; change the scene")
            with named(text):  # a fit may end at a limit
                for limit in filter(np.isfinite, (low, high)):
                    numbers.scene({path: limit})
        # A number that is 0 has no size of its own.
        size = abs(value) or (0.01 * radius if unit == "m" else 0.01)
        if unit == "m":
            size = max(size, 0.1 * radius) if last in "xyz" else size
        yield _Unknown(path, value, size, unit, low=low, high=high)


_WHOLE = ".inertia"  # after a body's name: its mass, its centre and its inertia
_MOMENTS = ("x.x", "x.y", "x.z", "y.y", "y.z", "z.z")


def _of_body(numbers: Numbers, name: str, radius: float) -> Iterator[_Unknown]:
    paths = [f"{name}.mass", *(f"{name}.centre.{axis}" for axis in "xyz")]
    paths += [f"{name}{_WHOLE}.{which}" for which in _MOMENTS]
    values = np.array([numbers.value(path) for path in paths])
    mass, centre, moments = values[0], values[1:4], np.sqrt(values[[4, 7, 9]])
    sizes = [mass, *np.maximum(np.abs(centre), 0.1 * radius), *np.outer(moments, moments)[_UPPER]]
    try:
        _other_inertia(values, np.zeros(len(paths)))
    except np.linalg.LinAlgError:
        raise InputError(
            f"{name}{_WHOLE}: no body of any thickness has the mass and inertia from which the fit "
            "begins; each moment must be less than the two others together"
        ) from None
    for path, value, size in zip(paths, values.tolist(), sizes, strict=True):
        yield _Unknown(path, value, float(size), numbers.unit(path), whole=True)


_UPPER = np.triu_indices(3)


def _other_inertia(numbers: Array, x: Array) -> Array:
    """Return the mass, centre and moments (10,) of another body; that of x = 0 is the same one.

    The pseudo-inertia, ∫(r, 1)(r, 1)ᵀdm, is positive definite for any body of any thickness, and
    for no other: it is sought by the logarithms of its Cholesky factor over the first one's (C.
    Rucker and P. M. Wensing, IEEE Robotics and Automation Letters 7 (2022) 2709).
    """
    first, factor = np.empty((4, 4)), np.diag(np.exp(x[:4]))
    mass, centre, inertia = numbers[0], numbers[1:4], np.empty((3, 3))
    inertia[_UPPER] = inertia.T[_UPPER] = numbers[4:]
    first[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia + mass * np.outer(centre, centre)
    first[3, :3] = first[:3, 3] = mass * centre
    first[3, 3] = mass
    factor[np.tril_indices(4, -1)] = x[4:]
    factor = np.linalg.cholesky(first) @ factor
    found = factor @ factor.T
    mass, centre = found[3, 3], found[3, :3] / found[3, 3]
    spread = found[:3, :3] - mass * np.outer(centre, centre)
    return np.array([mass, *centre, *(np.trace(spread) * np.eye(3) - spread)[_UPPER]])


def _limits(text: str, limits: str) -> tuple[float, float]:
    try:
        low, high = map(float, limits.split(":"))
    except ValueError:
        raise InputError(f"{text!r}: limits are two numbers, as in frame.kv=0.1:0.8") from None
    if not low < high:
        raise InputError(f"{text!r}: the first limit must be below the second")
    return low, high


def _of_log(scene: Scene, log: Log, at: int, freed: Sequence[str]) -> Iterator[_Unknown]:
    """Yield the unknowns of a log: its start, and the circumstances that are freed."""
    for axis in "xyz":
        yield _Unknown(f"start.turn.{axis}", 0.0, 0.1, "rad", at)
    for axis in "xy" if scene.rolling == "rubber" else "xyz":
        yield _Unknown(f"start.momentum.{axis}", 0.0, 0.1 * scene.momentum_scale, "kg m²/s", at)
    for hinge in scene.hinges:
        if hinge.motor is not None:
            yield _Unknown(f"start.{hinge.name}_angle", hinge.angle, 0.1, "rad", at)
            yield _Unknown(f"start.{hinge.name}_rate", hinge.rate, 0.1, "rad/s", at)
    sensors = {each.name: each for each in log.sensors}
    sizes = {"rad": 0.1, "m": 0.1 * scene.ball.radius, "rad/s": 0.1, "m/s²": 0.1, "s": 0.01}
    for name in freed:
        with_count, unit = circumstance(name, sensors)
        for i in range(with_count):
            part = f"{name}.{'xyz'[i]}" if with_count > 1 else name
            low = 0.0 if name == "commands.delay" else -np.inf
            yield _Unknown(part, 0.0, sizes[unit], unit, at, not is_of_readings(name), low)


@dataclass(frozen=True)
class _Sensed:
    """A log as it is fitted: its sensors' noise, and the start from which its motion is sought."""

    log: Log
    noise: tuple[float, ...]
    estimated: tuple[bool, ...]
    start: Scene

    def until(self, part: float) -> "_Sensed":
        """Return the first part of the log, of some readings at least."""
        few = min(float(s.times[:_FIRST][-1]) for s in self.log.sensors)
        end = max(part * self.log.end, few)
        sensors = tuple(
            replace(s, times=s.times[s.times <= end], values=s.values[s.times <= end])
            for s in self.log.sensors
        )
        return replace(self, log=replace(self.log, sensors=sensors))


class _Residuals:
    """The residuals of logs as a function of the unknowns, which are given in their sizes."""

    def __init__(
        self,
        numbers: Numbers,
        unknowns: Sequence[_Unknown],
        logs: Sequence[_Sensed],
        run: Run,
        fixed: Mapping[str, float],
    ) -> None:
        self.numbers, self.unknowns, self.logs, self.run = numbers, unknowns, logs, run
        self.fixed = fixed
        self._motion = lru_cache(maxsize=2 * len(logs) + 2)(self._moved)
        # A fit that ends asks once more for those of its last step.
        self._derivatives = lru_cache(maxsize=len(logs))(self._by_motion)
        self._of = [
            [j for j, u in enumerate(unknowns) if u.log in (None, k)] for k in range(len(logs))
        ]
        self._moving = [[j for j in of if unknowns[j].moves] for of in self._of]

    def values(self, x: Array) -> Array:
        """Return the unknowns in their units."""
        found = np.array([u.value + u.size * a for u, a in zip(self.unknowns, x, strict=True)])
        first = np.array([u.value for u in self.unknowns])
        whole = np.flatnonzero([u.whole for u in self.unknowns]).reshape(-1, 4 + len(_MOMENTS))
        for body in whole:
            found[body] = _other_inertia(first[body], x[body])
        return found

    def ended(self, values: Array) -> list[_Unknown]:
        """Return the unknowns with their values and sizes as they are where the fit ends."""
        sizes = (
            max(abs(v), u.size / 2) if u.size == abs(u.value) else u.size
            for u, v in zip(self.unknowns, values.tolist(), strict=True)
        )
        return [
            replace(u, value=v, size=size)
            for u, v, size in zip(self.unknowns, values.tolist(), sizes, strict=True)
        ]

    def slopes(self, x: Array, sized: Sequence[_Unknown]) -> Array:
        """Return the derivative (p, p) of the values, in such sizes."""
        steps = _DIFFERENCE * np.eye(len(x))
        columns = [self.values(x + step) - self.values(x - step) for step in steps]
        return np.array(columns).T / (2 * _DIFFERENCE) / [[u.size] for u in sized]

    def scene(self, k: int, values: Array) -> Scene:
        """Return the scene of a log. Raises InputError for impossible numbers."""
        own = {u.name: v for u, v in zip(self.unknowns, values, strict=True) if u.log == k}
        shared = {u.name: v for u, v in zip(self.unknowns, values, strict=True) if u.log is None}
        began, log = self.logs[k].start, self.logs[k].log
        scene = self.numbers.scene({**self.fixed, **shared})
        late = own.get("commands.delay", 0.0)
        commands = {name: held(t + late, values) for name, (t, values) in log.commands.items()}
        hinges: dict[str, dict[str, object]] = {"angle": {}, "rate": {}, "command": {}}
        for hinge in scene.hinges:
            if hinge.motor is not None:
                hinges["angle"][hinge.name] = own[f"start.{hinge.name}_angle"]
                hinges["rate"][hinge.name] = own[f"start.{hinge.name}_rate"]
            if hinge.name in commands:
                hinges["command"][hinge.name] = commands[hinge.name]
        scene = scene.with_hinges(**{k: v for k, v in hinges.items() if v})
        if actuators := [
            replace(each, command=commands.get(each.name, each.command)) for each in scene.actuators
        ]:
            scene = replace(scene, actuators=tuple(actuators))
        turn = np.array([own[f"start.turn.{axis}"] for axis in "xyz"])
        momentum = began.start.momentum.copy()
        for i, axis in enumerate("xyz"):
            momentum[i] += own.get(f"start.momentum.{axis}", 0.0)
        return replace(scene, start=Start(turned(began.start.attitude, turn), momentum))

    def given(self, k: int, values: Array) -> dict[str, Array]:
        """Return the circumstances of a log by their names."""
        found: dict[str, list[float]] = {}
        for u, v in zip(self.unknowns, values, strict=True):
            if u.log == k and not u.of_start:
                vector = u.name.count(".") > 1
                found.setdefault(u.name.rpartition(".")[0] if vector else u.name, []).append(v)
        return {name: np.array(parts) for name, parts in found.items()}

    def _asked(self, k: int, values: Array) -> tuple[Scene, Array, list[Array]]:
        """Return a log's scene, the times of its motion, and those at which sensors read it."""
        given = self.given(k, values)
        wanted = [times_of(each, given) for each in self.logs[k].log.sensors]
        return self.scene(k, values), np.unique(np.concatenate([[0.0], *wanted])), wanted

    def _moved(self, k: int, key: tuple[float, ...]) -> tuple[Motion, list[Rows]] | None:
        """Return a log's motion, and the rows that each sensor reads; None where none."""
        values = np.array([u.value for u in self.unknowns])
        values[self._moving[k]] = key
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            try:
                scene, times, wanted = self._asked(k, values)
                motion = self.run(scene, times)
            except InputError:
                return None
        if len(motion.times) < len(times):
            return None
        return motion, [np.searchsorted(times, each) for each in wanted]

    def of_log(self, k: int, x: Array) -> list[Array] | None:
        """Return how far the readings of a log's sensors are from its motion's; None for none."""
        values = self.values(x)
        moved = self._motion(k, tuple(values[self._moving[k]].tolist()))
        return None if moved is None else self._apart(k, values, *moved)

    def _apart(self, k: int, values: Array, motion: Motion, rows: list[Rows]) -> list[Array]:
        given, sensors = self.given(k, values), self.logs[k].log.sensors
        return [apart(s, motion, r, given) for s, r in zip(sensors, rows, strict=True)]

    def _part(self, k: int, x: Array) -> Array:
        found = self.of_log(k, x)
        if found is None:
            count = sum(len(s.values) * _width(s.values, s.name) for s in self.logs[k].log.sensors)
            return np.full(count, np.inf)
        return self._weighed(k, found)

    def _weighed(self, k: int, found: list[Array]) -> Array:
        weighted = zip(found, self.logs[k].noise, strict=True)
        return np.concatenate([(each / noise).ravel() for each, noise in weighted])

    def _by_motion(self, k: int, at: tuple[float, ...]) -> dict[int, Array]:
        """Return the derivatives (n,) of a log's residuals by unknowns that change its motion.

        Not by those that change the times of breakpoints and readings; by none of a run by an
        engine, nor of a scene with a controller.
        """
        from robotball.engines.multibody import integrate_together  # which loads numba

        if self.run is not _by_equations:
            return {}
        x = np.array(at)
        values = {j: self.values(x + _SMALL * (np.arange(len(x)) == j)) for j in self._moving[k]}
        given = self.values(x)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            first, times, wanted = self._asked(k, given)
            if first.controller is not None:
                return {}
            scenes = {}
            for j, others in values.items():
                with suppress(InputError):  # no scene there
                    scene, own, _ = self._asked(k, others)
                    if np.array_equal(own, times) and scene.breakpoints == first.breakpoints:
                        scenes[j] = scene
            try:
                motions = integrate_together([first, *scenes.values()], times, _ROUGH_RTOL)
            except InputError:
                return {}
        if len(motions[0].times) < len(times):
            return {}
        rows = [np.searchsorted(times, each) for each in wanted]
        before = self._weighed(k, self._apart(k, given, motions[0], rows))
        return {
            j: (self._weighed(k, self._apart(k, values[j], motion, rows)) - before) / _SMALL
            for j, motion in zip(scenes, motions[1:], strict=True)
        }

    def __call__(self, x: Array) -> Array:
        """Return the residuals over their noise (n,); inf where there is no motion."""
        return np.concatenate([self._part(k, x) for k in range(len(self.logs))])

    def jacobian(self, x: Array, central: bool = False) -> Array:
        """Return the derivative of the residuals (n, p), by differences.

        Those of an engine's motions are to one side, as good as a step needs, or central.
        """
        parts = [self._part(k, x) for k in range(len(self.logs))]
        ends = np.cumsum([0, *map(len, parts)])
        derivative = np.zeros((ends[-1], len(x)))
        for k, part in enumerate(parts):
            known = self._derivatives(k, tuple(x.tolist()))
            for j in self._of[k]:
                sides = (
                    [known[j]]
                    if j in known
                    else [
                        (self._part(k, x + step * (np.arange(len(x)) == j)) - part) / step
                        for step in (_DIFFERENCE, -_DIFFERENCE)[: 2 if central else 1]
                    ]
                )
                possible = [each for each in sides if np.isfinite(each).all()]
                if possible:
                    derivative[ends[k] : ends[k + 1], j] = np.mean(possible, axis=0)
        return derivative


def _width(values: Array, name: str) -> int:
    return 3 if name.endswith("attitude") else values.shape[1]


def held(times: Array, values: Array) -> Held:
    """Return a log's commands as a drive, each held until the next that differs."""
    changes = np.flatnonzero(np.diff(values)) + 1
    command = Held(Constant(float(values[0])))
    for t, value in zip(times[changes].tolist(), values[changes].tolist(), strict=True):
        command.hold(t, Constant(value))
    command.breakpoints = tuple(command.times)
    return command


def _by_equations(scene: Scene, times: Array) -> Motion:
    return integrate(scene, times, _RTOL)


def fit(
    scene: Numbers | Scene | str | Path,
    logs: Sequence[Log],
    free: Sequence[str],
    *,
    circumstances: Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    loss: str = "linear",
    hold_out: int | None = None,
    run: Run | None = None,
    minimize: Callable[..., Any] = least_squares,
    progress: Callable[[float, float], None] | None = None,
) -> Fit:
    """Fit numbers of a scene to the logs of a robot.

    Parameters
    ----------
    scene : Numbers, Scene, str or Path
        The robot, with the numbers from which the fit begins.
    logs : sequence of Log
        One log or more, as `read_log` returns them.
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
        Minimizes as scipy's `least_squares`, which is the default.
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
    >>> from pathlib import Path
    >>> import robotball as rb
    >>> scene = rb.load_scene("pendulum_robot")
    >>> rb.integrate(scene, rb.sample_times(2.0)).save("run.csv")
    >>> log = rb.read_log(Path("run.csv"), scene)
    >>> noise = {"position": 1e-3, "attitude": 1e-2, "gyro": 2e-2, "frame_angle": 1e-2}
    >>> noise.update(frame_rate=2e-2, frame_torque=1e-2)
    >>> found = rb.fit("pendulum_robot", [log], ["frame.kv"], noise=noise)
    >>> print(f"{found.found[0].value:.3f}")
    0.400
    """
    if not logs:
        raise InputError("a fit needs a log")
    if loss not in _LOSSES:
        raise unknown("loss", loss, _LOSSES)
    numbers = numbers_of(scene).with_whole(
        [name.removesuffix(_WHOLE) for name in free if name.endswith(_WHOLE)]
    )
    began = numbers.scene({})
    run = run or _by_equations
    sensed = [_sensed(began, log, noise or {}) for log in logs]
    own = list(_of_scene(numbers, free, began.ball.radius))
    fitted = [each for k, each in enumerate(sensed) if k != hold_out]
    unknowns = list(own)
    for k, each in enumerate(fitted):
        unknowns += _of_log(each.start, each.log, k, circumstances)
    _check_names(own)
    x, residuals, J = _solved(numbers, unknowns, fitted, run, {}, loss, minimize, progress)
    values, left = residuals.values(x), residuals(x)
    keep = _felt(J, unknowns)
    ended = residuals.ended(values)
    slopes = residuals.slopes(x, ended)[np.ix_(keep, keep)]
    covariance = slopes @ _covariance(J[:, keep]) @ slopes.T
    if loss == "linear":
        covariance = _widened(covariance, slopes, np.flatnonzero(keep), x, residuals, ended)
    deviations = np.full(len(x), np.nan)
    deviations[keep] = np.sqrt(np.diag(covariance))
    degrees = max(len(left) - int(keep.sum()), 1)
    held_out: tuple[SensorFit, ...] = ()
    if hold_out is not None:
        fixed = {u.name: float(v) for u, v in zip(own, values, strict=False)}
        held_out = _explained(sensed[hold_out], numbers, run, fixed, circumstances, loss, minimize)
    still = [e.log.name for e in fitted if stands_still({s.name: s for s in e.log.sensors})]
    freed = list(_found(unknowns, ended, deviations, fitted, len(still) == len(fitted)))
    found = tuple(freed[: len(own)])
    fitted_scene = residuals.scene(0, values)
    block = covariance[: len(own), : len(own)]
    scale = np.sqrt(np.diag(block))
    chi2 = _sum(left, loss)
    estimated = [flag for each in fitted for flag in each.estimated]
    result = Fit(
        scene=fitted_scene,
        text=numbers.text({each.name: each.value for each in found}, fitted_scene),
        found=found,
        of_logs=tuple(freed[len(own) :]),
        correlations=block / np.outer(scale, scale),
        chi2=chi2,
        degrees=degrees,
        probability=_probability(chi2, degrees, len(left), any(estimated)),
        sensors=tuple(_sensor_fits(residuals, x, len(unknowns) / len(left), loss)),
        held_out=held_out,
        undetermined=(
            *(f"{name}: {_STILL}" for name in still),
            *_at_limits(own, values),
            *_undetermined(*_told(covariance, keep, ended, fitted)),
        ),
    )
    return replace(result, contradictions=tuple(_contradictions(logs, result.strays)))


_STILL = (
    "its sensors read the same all the time, but for noise; a robot that stands still tells "
    "nothing of its motion"
)


def _contradictions(logs: Sequence[Log], strays: Sequence[SensorFit]) -> Iterator[str]:
    """Yield a line for two sensors of a log of which one strays and that contradict each other."""
    astray = {(each.log, each.name) for each in strays}
    for log in logs:
        for pair in contradictions({each.name: each for each in log.sensors}):
            if astray & {(log.name, name) for name in pair}:
                yield (
                    f"{pair[0]} and {pair[1]} of {log.name} contradict each other, whatever the "
                    "model: check signs, units and axes, and the quaternion's order"
                )


def _check_names(unknowns: Sequence[_Unknown]) -> None:
    if not unknowns:
        raise InputError("nothing is free: name numbers of the scene, as frame.kv")
    names = [each.name for each in unknowns]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{name} is freed twice")


_FIRST = 5  # readings, whose median begins a fit


def _sensed(scene: Scene, log: Log, noise: Mapping[str, float]) -> _Sensed:
    """Return a log with its sensors' noise, and the start that its first readings show."""
    sizes, first = [], {}
    for sensor in log.sensors:
        first[sensor.name] = np.median(sensor.values[:_FIRST], axis=0)
        least = _SMALLEST * float(np.abs(sensor.values).max())
        estimate = max(noise_of(sensor), least)
        given = noise.get(sensor.name)
        if given is not None and not given > 0:
            raise InputError(f"the noise of {sensor.name} must be positive, not {given:g}")
        few, dead = len(sensor.times) < FEWEST, not np.ptp(sensor.values, axis=0).any()
        if given is None and (few or dead):
            what = "reads the same all the time" if dead else f"has {len(sensor.times)} readings"
            raise InputError(
                f"{log.name}: {sensor.name} {what}, which does not tell its noise; leave its "
                "columns out, or give its noise"
            )
        sizes.append(given or estimate)
    moved = [each.name for each in scene.hinges if each.motor is not None]
    begins = {
        kind: {n: float(first[f"{n}_{kind}"][0]) for n in moved if f"{n}_{kind}" in first}
        for kind in ("angle", "rate")
    }
    started = scene.with_hinges(**{kind: each for kind, each in begins.items() if each})
    # One reading, as the median of quaternions is none.
    seen = (each.values[0] for each in log.sensors if each.name == "attitude")
    attitude = next(seen, scene.start.attitude)
    omega = first.get("gyro", scene.angular_velocity_at(scene.start))
    started = replace(started, start=Start(attitude, np.zeros(3)))
    started = replace(started, start=Start(attitude, started.momentum_of(omega)))
    estimated = tuple(sensor.name not in noise for sensor in log.sensors)
    return _Sensed(log, tuple(sizes), estimated, started)


def _solved(
    numbers: Numbers,
    unknowns: Sequence[_Unknown],
    logs: Sequence[_Sensed],
    run: Run,
    fixed: Mapping[str, float],
    loss: Any,
    minimize: Callable[..., Any],
    progress: Callable[[float, float], None] | None = None,
) -> tuple[Array, _Residuals, Array]:
    """Return the unknowns that fit logs best, the residuals' function and their derivative there.

    In a narrow valley, differences to one side feign a slope along it that is as large as the one
    that tells the numbers apart: the last step, and the derivative, are those of central ones.
    """
    x = np.zeros(len(unknowns))
    low, high = (
        np.array([(getattr(u, side) - u.value) / u.size for u in unknowns])
        for side in ("low", "high")
    )
    shared = np.array([u.log is None for u in unknowns])
    for part in _PARTS:
        residuals = _Residuals(numbers, unknowns, [each.until(part) for each in logs], run, fixed)
        x = np.clip(x, low + _DIFFERENCE, high - _DIFFERENCE)
        if not np.isfinite(first := residuals(x)).all():
            _raise_cause(residuals, x, run)
        enough = _NO_GAIN / len(first) if loss == "linear" else _ENOUGH
        # A part of the logs may tell little of an unknown, which must not go astray on it.
        prior = np.where(shared, 1 / _PRIOR if part < 1 else _NO_EVIDENCE, _HARDLY)
        solved = minimize(
            _with_prior, x, _its_jacobian, (low, high), args=(residuals, prior), x_scale=1.0,
            ftol=enough if part == 1 else _ROUGHLY, xtol=_ENOUGH, gtol=_LEAST_SLOPE, loss=loss,
            max_nfev=_MOST_TRIALS, method="dogbox",
        )  # fmt: skip
        x = solved.x
        if progress is not None:
            progress(part, 2 * solved.cost / len(solved.fun))
    J, left = residuals.jacobian(x, central=True), _with_prior(x, residuals, prior)
    if loss == "linear":
        step = np.linalg.lstsq(np.concatenate([J, np.diag(prior)]), -left)[0]
        nearer = np.clip(x + step, low, high)
        after = _with_prior(nearer, residuals, prior)
        x = nearer if after @ after < left @ left else x
    return x, residuals, J


def _with_prior(x: Array, residuals: _Residuals, prior: Array) -> Array:
    return np.concatenate([residuals(x), prior * x])


def _its_jacobian(x: Array, residuals: _Residuals, prior: Array) -> Array:
    return np.concatenate([residuals.jacobian(x), np.diag(prior)])


_ENOUGH = 1e-6  # relative: a change that is no evidence
_NO_GAIN = 0.1  # of χ², where one more step, of the last derivative, takes what is left of it
_ROUGHLY = 1e-2  # of a part of the logs, from which the fit goes on
_MOST_TRIALS = 30
_HARDLY = 1e-2  # per size: keeps a start that changes nothing where it is
_LEAST_SLOPE = 1e-15  # no end by it: χ² tells


def _raise_cause(residuals: _Residuals, x: Array, run: Run) -> None:
    """Raise InputError: why the scene has no motion to begin with."""
    values = residuals.values(x)
    for k, each in enumerate(residuals.logs):
        with named(each.log.name):
            scene = residuals.scene(k, values)
            motion = run(scene, np.array([0.0, each.log.end]))
            if len(motion.times) < 2:
                raise InputError(f"the motion of {scene.name} ends before the log")
    raise InputError(f"{scene.name} has no motion over the whole of the logs to begin with")


def _felt(J: Array, unknowns: Sequence[_Unknown]) -> Mask:
    """Return which unknowns count (p,): those of the start that change nothing do not."""
    changes = np.linalg.norm(J, axis=0) > 0
    return np.array([f or u.log is None for f, u in zip(changes, unknowns, strict=True)])


_NO_EVIDENCE = 1e-3  # per size: a derivative that rounding may have made


def _covariance(J: Array) -> Array:
    """Return the covariance (p, p) of unknowns in their sizes, finite where nothing is known."""
    _, singular, axes = np.linalg.svd(J, full_matrices=False)
    return np.asarray((axes.T / np.hypot(singular, _NO_EVIDENCE) ** 2) @ axes)


def _widened(
    covariance: Array,
    slopes: Array,
    at: Rows,
    x: Array,
    residuals: _Residuals,
    ended: Sequence[_Unknown],
) -> Array:
    """Return the covariance (p, p) with deviations that χ² itself has, by refits of the others.

    A gain times a starting rate may be found of noise alone, and the gain as exactly as the noise
    makes the rate large. But without that rate, any gain explains the logs nearly as well, and χ²
    soon rises no more: a deviation is doubled until three of it, away from 0, where χ² is flatter,
    raise χ² by 4.

    slopes: (p, p), the derivative of the values by x[at], in the values' sizes.
    """
    scale, squares = np.ones(len(at)), _sum(residuals(x), "linear")
    for i, j in enumerate(at):
        deviation = float(np.sqrt(covariance[i, i]))
        if ended[j].of_start or deviation < _CURVED:
            continue
        along, hold = np.zeros((2, len(x)))
        along[at] = np.linalg.solve(slopes, covariance[i]) / deviation
        hold[at] = slopes[i] / (_NO_EVIDENCE * deviation)
        far = np.copysign(_FAR, ended[j].value) * along
        while scale[i] * deviation < _UNKNOWN and (
            _refitted(x + scale[i] * far, hold, residuals) < squares + _RISE
        ):
            scale[i] *= 2
    return scale[:, None] * covariance * scale


@np.errstate(over="ignore", invalid="ignore")  # a step may lead to where no body is
def _refitted(x: Array, hold: Array, residuals: _Residuals) -> float:
    """Return χ² after a step to the best x of which hold · x is the same; inf for no motion."""
    before = _sum(residuals(x), "linear")
    if not np.isfinite(before):
        return before
    J = np.concatenate([residuals.jacobian(x), [hold], _NO_EVIDENCE * np.eye(len(x))])
    left = np.concatenate([residuals(x), np.zeros(1 + len(x))])
    return min(before, _sum(residuals(x - np.linalg.lstsq(J, left)[0]), "linear"))


def _found(
    began: Sequence[_Unknown],
    ended: Sequence[_Unknown],
    deviations: Array,
    logs: Sequence[_Sensed],
    still: bool,
) -> Iterator[Found]:
    """Yield what was found of all that a user freed, the numbers of the scene first.

    Of a robot that stands still the scene's numbers are not told: what seems so is noise times
    noise, such as a gain times the rate at which the fit lets the motor start.
    """
    for first, last, deviation in zip(began, ended, deviations.tolist(), strict=True):
        if not first.of_start:
            name = _full_name(first, logs)
            told = deviation < _UNKNOWN and not (still and first.log is None)
            size, unit = deviation * last.size, first.unit
            yield Found(name, last.value, size, first.value, unit, told)


def _full_name(unknown: _Unknown, logs: Sequence[_Sensed]) -> str:
    """Return an unknown's name, after that of its log where it belongs to one."""
    return unknown.name if unknown.log is None else f"{logs[unknown.log].log.name}: {unknown.name}"


def _at_limits(unknowns: Sequence[_Unknown], values: Array) -> Iterator[str]:
    """Yield a line for each number that ended at a limit, beyond which nothing was tried."""
    for each, value in zip(unknowns, values.tolist(), strict=False):
        for limit in (each.low, each.high):
            if abs(value - limit) < _AT_LIMIT * each.size:
                what = f"ended at its limit of {limit:.3g}: the logs would have it beyond"
                yield f"{each.name} {what}"


def _told(
    covariance: Array, keep: Mask, unknowns: Sequence[_Unknown], logs: Sequence[_Sensed]
) -> tuple[Array, list[_Unknown]]:
    """Return the unknowns that a user freed, with their covariance; whatever the starts are."""
    kept = [u for u, felt in zip(unknowns, keep, strict=True) if felt]
    of: list[int] = [i for i, u in enumerate(kept) if not u.of_start]
    named = [replace(kept[i], name=_full_name(kept[i], logs)) for i in of]
    return covariance[np.ix_(of, of)], named


def _undetermined(covariance: Array, unknowns: Sequence[_Unknown]) -> Iterator[str]:
    """Yield what the logs cannot tell, by the directions in which the unknowns may go."""
    variances, axes = np.linalg.eigh(covariance)
    directions = axes[:, variances > _UNKNOWN**2].T
    for direction in _sparse(directions):
        parts = [i for i in range(len(unknowns)) if abs(direction[i]) > _SHARE]
        names = [unknowns[i].name for i in parts]
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
            f"of {unknowns[i].name}"
            for i in parts
        )
        yield f"not determined apart: {changes}, together, change nothing that was measured"


def _sparse(directions: Array) -> Array:
    """Return a basis (m, p) of the same space, in which each direction has a part of its own."""
    rows = directions.copy()
    for i in range(len(rows)):
        rest = np.abs(rows[i:])
        r, c = np.unravel_index(int(rest.argmax()), rest.shape)
        rows[[i, i + int(r)]] = rows[[i + int(r), i]]
        rows[i] /= rows[i, c]
        for other in range(len(rows)):
            if other != i:
                rows[other] -= rows[other, c] * rows[i]
    return rows


def _sum(left: Array, loss: str) -> float:
    """Return χ², in which outliers count as the loss has them."""
    return float(_LOSSES[loss](left**2).sum())


def _probability(chi2: float, degrees: float, count: int, estimated: bool) -> float:
    """Return how probable a χ² at least as large is; noise that is estimated is uncertain too."""
    if estimated:
        return float(stats.f.sf(chi2 / degrees, degrees, _NOISE_KNOWN_BY * count))
    return float(stats.chi2.sf(chi2, degrees))


def _sensor_fits(residuals: _Residuals, x: Array, fitted: float, loss: str) -> Iterator[SensorFit]:
    """Yield how well each sensor is explained; fitted: unknowns per reading."""
    for k, sensed in enumerate(residuals.logs):
        found = residuals.of_log(k, x)
        assert found is not None  # the fit ended in a motion
        for sensor, noise, estimated, left in zip(
            sensed.log.sensors, sensed.noise, sensed.estimated, found, strict=True
        ):
            degrees = max(left.size * (1 - fitted), 1.0)
            probability = _probability(_sum(left / noise, loss), degrees, left.size, estimated)
            yield SensorFit(
                sensed.log.name, sensor.name, noise, float(np.sqrt((left**2).mean())), probability,
                _since(sensor.times, left / noise) if probability < _DOUBT else None,
                sensor.times, left,
            )  # fmt: skip


def _since(times: Array, weighed: Array) -> float:
    """Return the time from which on readings are not explained [s]."""
    for rows in np.array_split(np.arange(len(times)), min(_WINDOWS, len(times))):
        part = weighed[rows]
        if stats.chi2.sf(float((part**2).sum()), part.size) < _DOUBT / _WINDOWS:
            return float(times[rows[0]])
    return float(times[0])


def _explained(
    log: _Sensed,
    numbers: Numbers,
    run: Run,
    fixed: Mapping[str, float],
    circumstances: Sequence[str],
    loss: str,
    minimize: Callable[..., Any],
) -> tuple[SensorFit, ...]:
    """Return how well fitted numbers explain a log, of which the start alone is found."""
    unknowns = list(_of_log(log.start, log.log, 0, circumstances))
    x, residuals, _ = _solved(numbers, unknowns, [log], run, fixed, loss, minimize)
    return tuple(_sensor_fits(residuals, x, len(unknowns) / len(residuals(x)), loss))
