"""Unknowns of a fit, and the residuals between logs and simulated motions.

The unknowns are numbers of the scene, which the logs share, and for each log the initial state of
its motion and circumstances, such as a gyro bias. Residuals are (reading - model)/noise;
derivatives are finite differences.
"""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np

from robotball.engines.equations import integrate
from robotball.errors import InputError, SceneWarning, named
from robotball.files.scene_tables import Numbers
from robotball.fit.logs import Log
from robotball.fit.sensing import Rows, apart, circumstance, is_of_readings, times_of
from robotball.motion import Motion
from robotball.robot.drives import Constant
from robotball.robot.function_drives import HeldCommand
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, turned

Change = Callable[[Scene, float], Scene]
ADDED = "added"  # an unknown that changes the scene
FIRST = 5  # readings, whose median gives the initial state
# Tolerance of the equations. On five robots over 3 to 10 s, the error of readings is at most 5e-8
# of the largest reading. With 1e-9 the error is 2e-4, because readings are interpolated within long
# steps.
_RTOL = 1e-11
_MOST_STEPS = 1_500  # per second; catalog scenes take below 400, and wild trials are given up early
_MOST_ROUGH_STEPS = 500  # for neighbours together, which take many if they slip differently
_DIFFERENCE = 1e-3  # of an unknown's size, for finite differences
# Difference and tolerance if the equations integrate neighbours with the same steps: the errors of
# neighbours are almost equal, and the relative error of a derivative is 1e-4.
_SMALL, _ROUGH_RTOL = 1e-6, 1e-7
# The difference if the shell may slip. The slip velocities of neighbours must be almost equal when
# the slip ends, at `friction._STOPPED`. The relative error of a derivative is 1e-4, too, because of
# rounding.
_SMALL_OF_SLIPS = 1e-9
_LEAST = 1e-12  # of its initial value: lower limit of a positive number
_POSITIVE = {"mass", "density", "radius", "kv", "kp", "gravity", "rolling", "sliding", "torsional"}
_POSITIVE |= {"torque_limit", "stall_torque"}
WHOLE = ".inertia"  # suffix of a body's name: its mass, centre and inertia as a whole
_MOMENTS = ("x.x", "x.y", "x.z", "y.y", "y.z", "z.z")
_UPPER = np.triu_indices(3)


@dataclass(frozen=True)
class Unknown:
    """A number to be fitted, with its initial value, size and limits.

    Attributes
    ----------
    log : index of its log, or None for a number of the scene
    moves : whether it affects the motion, not only the readings
    whole : whether it is one of the ten numbers of a body's inertia, which are fitted together
    of : prefix with the name of its log
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
    of: str = ""

    @property
    def full_name(self) -> str:
        """The name, prefixed with the name of its log."""
        return self.of + self.name

    @property
    def of_friction(self) -> bool:
        """Whether it is a limit of friction, which has no effect unless a motion reaches it."""
        return self.name in ("friction.sliding", "friction.torsional")

    @property
    def of_start(self) -> bool:
        """Whether it belongs to a rolling initial state, which is always fitted."""
        return self.name.startswith("start.") and not self.name.startswith("start.slip.")


@dataclass(frozen=True)
class FittedLog:
    """A log with its sensors' noise, and a scene with the initial guess of its initial state.

    estimated: for each sensor, whether its noise was estimated from the readings; first: first
    values of other unknowns, by name.
    """

    log: Log
    noise: tuple[float, ...]
    estimated: tuple[bool, ...]
    start: Scene
    first: Mapping[str, Array] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of residuals; an attitude has three, not four."""
        return sum(
            s.values[:, 1:].size if s.name.endswith("attitude") else s.values.size
            for s in self.log.sensors
        )

    def until(self, part: float) -> "FittedLog":
        """Return the first part of the log, with at least `FIRST` readings of each sensor."""
        few = min(float(s.times[:FIRST][-1]) for s in self.log.sensors)
        end = max(part * self.log.end, few)
        sensors = tuple(
            replace(s, times=s.times[s.times <= end], values=s.values[s.times <= end])
            for s in self.log.sensors
        )
        return replace(self, log=replace(self.log, sensors=sensors))


def of_scene(numbers: Numbers, free: Sequence[str], radius: float) -> list[Unknown]:
    """Return the unknowns for paths, paths with limits (path=low:high) and bodies' inertias.

    Raises InputError if `free` is empty, or a name is unknown or repeated.
    """
    unknowns: list[Unknown] = []
    for text in free:
        if text.endswith(WHOLE):
            unknowns += _of_body(numbers, text.removesuffix(WHOLE), radius)
        else:
            unknowns.append(_of_path(numbers, text, radius))
    if not unknowns:
        raise InputError("nothing to fit: free numbers of the scene, such as frame.kv")
    names = [unknown.name for unknown in unknowns]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{name} is freed twice")
    return unknowns


def _of_path(numbers: Numbers, text: str, radius: float) -> Unknown:
    name, _, limits = text.partition("=")
    path = numbers.path_of(name.strip())
    value, unit, _ = numbers.known[path]
    last = path.rpartition(".")[2]
    # Not 0, which would remove the motor or body.
    low, high = _LEAST * value if value >= 0 and last in _POSITIVE else -np.inf, np.inf
    if limits:
        low, high = _limits(text, limits)
        if not low <= value <= high:
            raise InputError(f"{path} is {value:g}, outside {limits}: change the scene")
        with named(text):  # a fit may end at its limits, so the scene must be valid there
            for limit in filter(np.isfinite, (low, high)):
                numbers.scene({path: limit})
    # A number that is 0 has no natural size.
    size = abs(value) or (0.01 * radius if unit == "m" else 0.01)
    if unit == "m" and last in "xyz":
        size = max(size, 0.1 * radius)
    return Unknown(path, value, size, unit, low=low, high=high)


def _limits(text: str, limits: str) -> tuple[float, float]:
    try:
        low, high = map(float, limits.split(":"))
    except ValueError:
        raise InputError(f"{text!r}: limits are two numbers, such as frame.kv=0.1:0.8") from None
    if not low < high:
        raise InputError(f"{text!r}: the first limit must be below the second")
    return low, high


def _of_body(numbers: Numbers, name: str, radius: float) -> Iterator[Unknown]:
    paths = [f"{name}.mass", *(f"{name}.centre.{axis}" for axis in "xyz")]
    paths += [f"{name}{WHOLE}.{which}" for which in _MOMENTS]
    known = [numbers.known[path] for path in paths]
    values = np.array([number.value for number in known])
    mass, centre, moments = values[0], values[1:4], np.sqrt(values[[4, 7, 9]])
    sizes = [mass, *np.maximum(np.abs(centre), 0.1 * radius), *np.outer(moments, moments)[_UPPER]]
    try:
        _other_inertia(values, np.zeros(len(paths)))
    except np.linalg.LinAlgError:
        raise InputError(
            f"{name}{WHOLE}: the initial mass and inertia are impossible for a solid body: each "
            "moment must be less than the sum of the two others"
        ) from None
    for path, (value, unit, _), size in zip(paths, known, sizes, strict=True):
        yield Unknown(path, value, float(size), unit, whole=True)


def _other_inertia(numbers: Array, x: Array) -> Array:
    """Return a body's mass, centre and moments (10,) at coordinates x (10,); x = 0: unchanged.

    The pseudo-inertia ∫(r, 1)(r, 1)ᵀdm is positive definite iff the body is physical. Coordinates
    describe its Cholesky factor relative to the initial one, with the logarithm of the diagonal
    (C. Rucker and P. M. Wensing, IEEE Robotics and Automation Letters 7 (2022) 2709).
    """
    first, factor = np.empty((4, 4)), np.diag(np.exp(x[:4]))
    mass, centre, inertia = numbers[0], numbers[1:4], np.empty((3, 3))
    inertia[_UPPER] = inertia.T[_UPPER] = numbers[4:]
    first[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia + mass * np.outer(centre, centre)
    first[3, :3] = first[:3, 3] = mass * centre
    first[3, 3] = mass
    factor[np.tril_indices(4, -1)] = x[4:]
    factor = np.linalg.cholesky(first) @ factor
    pseudo = factor @ factor.T
    mass, centre = pseudo[3, 3], pseudo[3, :3] / pseudo[3, 3]
    spread = pseudo[:3, :3] - mass * np.outer(centre, centre)
    return np.array([mass, *centre, *(np.trace(spread) * np.eye(3) - spread)[_UPPER]])


def of_log(fitted: FittedLog, at: int, freed: Sequence[str]) -> Iterator[Unknown]:
    """Yield the unknowns of log number `at`: its initial state and its freed circumstances."""
    scene, log = fitted.start, fitted.log
    new = partial(Unknown, log=at, of=f"{log.name}: ")
    for axis in "xyz":
        yield new(f"start.turn.{axis}", 0.0, 0.1, "rad")
    for axis in "xy" if scene.rolling == "rubber" else "xyz":
        yield new(f"start.momentum.{axis}", 0.0, 0.1 * scene.momentum_scale, "kg m²/s")
    for hinge in scene.hinges:
        if hinge.motor is not None:
            yield new(f"start.{hinge.name}_angle", hinge.angle, 0.1, "rad")
            yield new(f"start.{hinge.name}_rate", hinge.rate, 0.1, "rad/s")
    if scene.start.slips:  # otherwise the shell sticks at the start
        units = "m/s", "m/s", "rad/s"
        for axis, value, unit, limit in zip(
            "xyz", scene.start.slip.tolist(), units, scene.slip_limits, strict=True
        ):
            if np.isfinite(limit):
                yield new(f"start.slip.{axis}", value, 0.1, unit)
    if "start.place" in fitted.first:
        for axis, value in zip("xy", fitted.first["start.place"].tolist(), strict=True):
            yield new(f"start.place.{axis}", value, 0.1 * scene.ball.radius, "m", moves=False)
    for name in dict.fromkeys(freed):
        yield from of_circumstance(fitted, at, name)


def of_circumstance(fitted: FittedLog, at: int, name: str) -> Iterator[Unknown]:
    """Yield the unknowns of a log's circumstance. Raises InputError for an unknown name."""
    log, radius = fitted.log, fitted.start.ball.radius
    sizes = {"rad": 0.1, "m": 0.1 * radius, "rad/s": 0.1, "m/s²": 0.1, "s": 0.01, "1": 0.1}
    kind = circumstance(name, [sensor.name for sensor in log.sensors])
    new = partial(Unknown, log=at, of=f"{log.name}: ", moves=not is_of_readings(name))
    low = 0.0 if name == "commands.delay" else -np.inf
    values = fitted.first.get(name, np.zeros(kind.count)).tolist()
    for axis, value in zip("xyz", values, strict=False):
        title = f"{name}.{axis}" if kind.count > 1 else name
        yield new(title, value, sizes[kind.unit], kind.unit, low=low)


class Residuals:
    """Residuals of logs as a function of the unknowns x (p,), in units of their sizes.

    fixed: further numbers of the scene that differ from its file. deadline: time on the monotonic
    clock [s] after which a motion raises TimeoutError. `best`: the least χ² so far, with its x.
    """

    def __init__(
        self,
        numbers: Numbers,
        unknowns: Sequence[Unknown],
        logs: Sequence[FittedLog],
        fixed: Mapping[str, float],
        deadline: float = np.inf,
    ) -> None:
        self.numbers, self.unknowns, self.logs = numbers, unknowns, logs
        self.change: Change | None = None
        self.fixed, self.deadline, self.best = fixed, deadline, (np.inf, np.empty(0))
        self._motion = lru_cache(maxsize=2 * len(logs) + 2)(self._run)
        # Most unknowns belong to initial states: one scene with the shared numbers serves many.
        self._shared_scene = lru_cache(maxsize=len(unknowns) + 2)(
            lambda shared: numbers.scene({**fixed, **dict(shared)})
        )
        # After its last step, a fit requests the same derivatives once more.
        self._derivatives = lru_cache(maxsize=len(logs))(self._by_motion)
        n = range(len(unknowns))
        self._of = [[j for j in n if unknowns[j].log in (None, k)] for k in range(len(logs))]
        self._moving = [[j for j in of if unknowns[j].moves] for of in self._of]

    def values(self, x: Array) -> Array:
        """Return the unknowns (p,) in their units."""
        values = np.array([u.value + u.size * a for u, a in zip(self.unknowns, x, strict=True)])
        first = np.array([u.value for u in self.unknowns])
        whole = np.flatnonzero([u.whole for u in self.unknowns]).reshape(-1, 4 + len(_MOMENTS))
        for body in whole:
            values[body] = _other_inertia(first[body], x[body])
        return values

    def ended(self, values: Array) -> list[Unknown]:
        """Return the unknowns with updated values, and sizes that match them."""
        return [
            replace(u, value=v, size=max(abs(v), u.size / 2) if u.size == abs(u.value) else u.size)
            for u, v in zip(self.unknowns, values.tolist(), strict=True)
        ]

    def slopes(self, x: Array, sized: Sequence[Unknown]) -> Array:
        """Return the derivative (p, p) of the values by x, in units of the sizes of `sized`."""
        steps = _DIFFERENCE * np.eye(len(x))
        columns = [self.values(x + step) - self.values(x - step) for step in steps]
        return np.array(columns).T / (2 * _DIFFERENCE) / [[u.size] for u in sized]

    def scene(self, k: int, values: Array) -> Scene:
        """Return the scene of a log. Raises InputError for impossible numbers."""
        of_log = {u.name: v for u, v in zip(self.unknowns, values, strict=True) if u.log == k}
        pairs = zip(self.unknowns, values.tolist(), strict=True)
        shared = tuple((u.name, v) for u, v in pairs if u.log is None)
        initial, log = self.logs[k].start.start, self.logs[k].log
        scene = self._shared_scene(shared)
        late = of_log.get("commands.delay", 0.0)
        commands = {name: held(t + late, values) for name, (t, values) in log.commands.items()}
        motors = [hinge.name for hinge in scene.hinges if hinge.motor is not None]
        hinges = {hinge.name for hinge in scene.hinges}
        scene = scene.with_hinges(
            angle={name: of_log[f"start.{name}_angle"] for name in motors},
            rate={name: of_log[f"start.{name}_rate"] for name in motors},
            command={name: command for name, command in commands.items() if name in hinges},
        )
        if actuators := [
            replace(actuator, command=commands.get(actuator.name, actuator.command))
            for actuator in scene.actuators
        ]:
            scene = replace(scene, actuators=tuple(actuators))
        turn = np.array([of_log[f"start.turn.{axis}"] for axis in "xyz"])
        momentum = initial.momentum.copy()
        for i, axis in enumerate("xyz"):
            momentum[i] += of_log.get(f"start.momentum.{axis}", 0.0)
        slip = np.array([of_log.get(f"start.slip.{axis}", 0.0) for axis in "xyz"])
        if self.change is not None:
            scene = self.change(scene, of_log[ADDED])
        return replace(scene, start=Start(turned(initial.attitude, turn), momentum, slip))

    def log_values(self, k: int, values: Array) -> dict[str, Array]:
        """Return the initial state and the circumstances of a log, keyed by name."""
        parts: dict[str, list[float]] = {}
        for u, v in zip(self.unknowns, values, strict=True):
            if u.log == k:
                vector = u.name.count(".") > 1
                parts.setdefault(u.name.rpartition(".")[0] if vector else u.name, []).append(v)
        return {name: np.array(components) for name, components in parts.items()}

    def _inputs(self, k: int, values: Array) -> tuple[Scene, Array, list[Array]]:
        """Return a log's scene, the times of its motion, and each sensor's times."""
        circumstances = self.log_values(k, values)
        at = [times_of(sensor, circumstances) for sensor in self.logs[k].log.sensors]
        return self.scene(k, values), np.unique(np.concatenate([[0.0], *at])), at

    def _run(self, k: int, key: tuple[float, ...]) -> tuple[Motion, list[Rows]] | None:
        """Return a log's motion and the rows that each sensor reads, or None if it fails."""
        if time.monotonic() > self.deadline:
            raise TimeoutError
        values = np.array([u.value for u in self.unknowns])
        values[self._moving[k]] = key
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            try:
                scene, times, at = self._inputs(k, values)
                motion = by_equations(scene, times)
            except InputError:
                return None
        if len(motion.times) < len(times):
            return None
        return motion, [np.searchsorted(times, sensor_times) for sensor_times in at]

    def of_log(self, k: int, x: Array) -> list[Array] | None:
        """Return readings minus model for each sensor of a log, or None without a motion."""
        values = self.values(x)
        result = self._motion(k, tuple(values[self._moving[k]].tolist()))
        return None if result is None else self._apart(k, values, *result)

    def _apart(self, k: int, values: Array, motion: Motion, rows: list[Rows]) -> list[Array]:
        circumstances, sensors = self.log_values(k, values), self.logs[k].log.sensors
        return [apart(s, motion, r, circumstances) for s, r in zip(sensors, rows, strict=True)]

    def needs(self, x: Array, sticking: bool = False) -> dict[int, float]:
        """Return the largest needed friction for each free limit of friction, by its index.

        sticking: leave out the times at which a shell slips.
        """
        values, needs = self.values(x), dict[int, float]()
        results = [self._motion(k, tuple(values[m].tolist())) for k, m in enumerate(self._moving)]
        motions = [result[0] for result in results if result is not None]
        for j, unknown in enumerate(self.unknowns):
            if unknown.of_friction:
                kind = unknown.name.replace("friction.", "") + "_friction"
                for motion in motions:
                    slip = getattr(motion, "slip", None) if sticking else None
                    counts = True if slip is None else ~slip.any(axis=1)
                    need = float(getattr(motion.loads, kind).max(initial=0.0, where=counts))
                    needs[j] = max(need, needs.get(j, 0.0))
        return needs

    def _part(self, k: int, x: Array) -> Array:
        differences = self.of_log(k, x)
        if differences is None:
            return np.full(self.logs[k].count, np.inf)
        return self._weighed(k, differences)

    def _weighed(self, k: int, differences: list[Array]) -> Array:
        pairs = zip(differences, self.logs[k].noise, strict=True)
        return np.concatenate([(left / noise).ravel() for left, noise in pairs])

    def _by_motion(self, k: int, at: tuple[float, ...]) -> dict[int, Array]:
        """Return derivatives (n,) of a log's residuals with respect to unknowns of its motion."""
        from robotball.theory.multibody.integration import integrate_together  # loads numba

        x = np.array(at)
        here, names = self.values(x), [sensor.name for sensor in self.logs[k].log.sensors]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            first, times, at_times = self._inputs(k, here)
            # Motions that are integrated together do not have the slip that an accelerometer feels.
            if first.controller is not None or (first.may_slip and "accelerometer" in names):
                return {}
            small, scenes = _SMALL_OF_SLIPS if first.may_slip else _SMALL, {}
            values = {j: self.values(x + small * (np.arange(len(x)) == j)) for j in self._moving[k]}
            for j, others in values.items():
                with suppress(InputError):  # impossible numbers
                    scene, scene_times, _ = self._inputs(k, others)
                    same = np.array_equal(scene_times, times)
                    if same and _state_of(scene) == _state_of(first):
                        scenes[j] = scene
            try:
                most = int(_MOST_ROUGH_STEPS * (1 + times[-1]))
                motions = integrate_together([first, *scenes.values()], times, _ROUGH_RTOL, most)
            except InputError:
                return {}
        if len(motions[0].times) < len(times):
            return {}
        rows = [np.searchsorted(times, sensor_times) for sensor_times in at_times]
        before = self._weighed(k, self._apart(k, here, motions[0], rows))
        return {
            j: (self._weighed(k, self._apart(k, values[j], motion, rows)) - before) / small
            for j, motion in zip(scenes, motions[1:], strict=True)
        }

    def __call__(self, x: Array) -> Array:
        """Return the residuals (n,) divided by their noise; inf without a motion."""
        left = np.concatenate([self._part(k, x) for k in range(len(self.logs))])
        with np.errstate(over="ignore"):
            self.best = min(self.best, (float(left @ left), x.copy()), key=lambda pair: pair[0])
        return left

    def jacobian(self, x: Array, central: bool = False) -> Array:
        """Return the derivative (n, p) of the residuals.

        central: use central instead of one-sided differences.
        """
        parts = []
        for k, log in enumerate(self.logs):
            known, part = self._derivatives(k, tuple(x.tolist())), np.zeros((log.count, len(x)))
            for j in self._of[k]:
                part[:, j] = known[j] if j in known else self._by_differences(k, x, j, central)
            parts.append(part)
        return np.concatenate(parts)

    def _by_differences(self, k: int, x: Array, j: int, central: bool = True) -> Array:
        """Return the derivative (n,) of a log's residuals by one unknown; 0 without a motion."""
        before = self._part(k, x)
        sides = [
            (self._part(k, x + step * (np.arange(len(x)) == j)) - before) / step
            for step in (_DIFFERENCE, -_DIFFERENCE)[: 2 if central else 1]
        ]
        possible = [side for side in sides if np.isfinite(side).all()]
        return np.asarray(np.mean(possible, axis=0)) if possible else np.zeros(len(before))

    def with_unknowns(self, others: Sequence[Unknown], change: Change | None) -> "Residuals":
        """Return the residuals with further unknowns after the others.

        change: the change of the scene for the value of an unknown `ADDED`.
        """
        unknowns = [*self.unknowns, *others]
        wider = Residuals(self.numbers, unknowns, self.logs, self.fixed, self.deadline)
        wider.change = change
        return wider

    def of_others(self, x: Array, others: Sequence[Unknown], change: Change | None = None) -> Array:
        """Return the derivative (n, m) of the residuals with respect to other unknowns."""
        wider = self.with_unknowns(others, change)
        derivative = np.zeros((sum(log.count for log in self.logs), len(others)))
        ends = np.cumsum([0, *(log.count for log in self.logs)])
        at = np.concatenate([x, np.zeros(len(others))])
        for i, unknown in enumerate(others):
            assert unknown.log is not None  # each circumstance belongs to a log
            rows = slice(ends[unknown.log], ends[unknown.log + 1])
            derivative[rows, i] = wider._by_differences(unknown.log, at, len(x) + i)
        return derivative


def _state_of(scene: Scene) -> tuple[object, ...]:
    """Return the features that scenes must share if their motions are integrated together."""
    return scene.breakpoints, scene.plane_is_still, scene.contact_moves


def held(times: Array, values: Array) -> HeldCommand:
    """Return a log's commands as a drive that holds each command until the next one."""
    changes = np.flatnonzero(np.diff(values)) + 1
    command = HeldCommand(Constant(float(values[0])))
    for t, value in zip(times[changes].tolist(), values[changes].tolist(), strict=True):
        command.hold(t, Constant(value))
    command.breakpoints = tuple(command.times)
    return command


def by_equations(scene: Scene, times: Array) -> Motion:
    """Return the motion of a scene at times (n,) [s], with the accuracy that a fit needs.

    Raises InputError if `integrate` raises it, and if the motion takes too many steps.
    """
    return integrate(scene, times, _RTOL, int(_MOST_STEPS * (1 + times[-1])))
