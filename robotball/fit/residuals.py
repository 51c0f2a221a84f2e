"""What a fit seeks, and how far the readings of logs are from those of its motions.

The unknowns are numbers of the scene, shared by all logs, and of each log the start of its motion
and such circumstances as a gyro's bias. Residuals are readings less those of the motion, over the
sensor's noise, with derivatives by differences.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from robotball.engines.equations import integrate
from robotball.errors import InputError, SceneWarning, named
from robotball.files.numbers import Numbers
from robotball.fit.logs import Log
from robotball.fit.sensing import Rows, apart, circumstance, is_of_readings, times_of
from robotball.motion import Motion
from robotball.robot.drives import Constant
from robotball.robot.function_drives import HeldCommand
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, turned

Run = Callable[[Scene, Array], Motion]
FIRST = 5  # readings, whose median begins a fit
# By scipy's names, what a squared residual counts.
LOSSES: Mapping[str, Callable[[Array], Array]] = {
    "linear": lambda z: z,
    "soft_l1": lambda z: 2 * (np.sqrt(1 + z) - 1),
    "huber": lambda z: np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
    "cauchy": np.log1p,
    "arctan": np.arctan,
}
# Of the equations. Measured on five robots over 3 to 10 s: readings err by at most 5e-8 of the
# largest one; at 1e-9 by 2e-4, as a reading lies between two long steps.
_RTOL = 1e-11
_MOST_STEPS = 1_500  # a second: wild trials are soon given up; catalog scenes take under 400
_DIFFERENCE = 1e-3  # of an unknown's size, by which residuals are differentiated
# The same, and the tolerance, where the equations move neighbours by the same steps: such motions
# err alike, and the derivative by 1e-4 of itself.
_SMALL, _ROUGH_RTOL = 1e-6, 1e-7
_LEAST = 1e-12  # of a positive number, below which it is not sought
_POSITIVE = ("mass", "density", "radius", "kv", "kp", "torque_limit", "stall_torque", "gravity",
             "rolling")  # fmt: skip
WHOLE = ".inertia"  # after a body's name: its mass, its centre and its inertia
_MOMENTS = ("x.x", "x.y", "x.z", "y.y", "y.z", "z.z")
_UPPER = np.triu_indices(3)


@dataclass(frozen=True)
class Unknown:
    """A number to be found: what it begins with, its size, and its limits.

    log: the number of the log that it belongs to, None where all share it, and of: its name and
    a colon; moves: whether it changes the motion, and not the readings alone; whole: whether it is
    one of the ten of a body's inertia, which are sought together.
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
        """The name, after that of its log where it belongs to one."""
        return self.of + self.name

    @property
    def of_start(self) -> bool:
        """Whether it is of a motion's start, which no user frees."""
        return self.name.startswith("start.")


@dataclass(frozen=True)
class FittedLog:
    """A log as it is fitted: its sensors' noise, and the start from which its motion is sought."""

    log: Log
    noise: tuple[float, ...]
    estimated: tuple[bool, ...]
    start: Scene

    @property
    def count(self) -> int:
        """The number of residuals: three of an attitude's four."""
        return sum(
            s.values[:, 1:].size if s.name.endswith("attitude") else s.values.size
            for s in self.log.sensors
        )

    def until(self, part: float) -> "FittedLog":
        """Return the first part of the log, of some readings at least."""
        few = min(float(s.times[:FIRST][-1]) for s in self.log.sensors)
        end = max(part * self.log.end, few)
        sensors = tuple(
            replace(s, times=s.times[s.times <= end], values=s.values[s.times <= end])
            for s in self.log.sensors
        )
        return replace(self, log=replace(self.log, sensors=sensors))


def of_scene(numbers: Numbers, free: Sequence[str], radius: float) -> list[Unknown]:
    """Return the unknowns of a scene: each a path, a path with limits, or a body's inertia.

    Raises InputError for what is no number of it or is freed twice, and where nothing is free.
    """
    found = [
        each
        for text in free
        for each in (
            _of_body(numbers, text.removesuffix(WHOLE), radius)
            if text.endswith(WHOLE)
            else [_of_path(numbers, text, radius)]
        )
    ]
    if not found:
        raise InputError("nothing is free: name numbers of the scene, as frame.kv")
    names = [each.name for each in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{name} is freed twice")
    return found


def _of_path(numbers: Numbers, text: str, radius: float) -> Unknown:
    """Return the number at a path, which may have limits, as path=low:high."""
    name, _, limits = text.partition("=")
    path = numbers.path_of(name.strip())
    value, unit, _ = numbers.known[path]
    last = path.rpartition(".")[2]
    # Not 0 itself, where a motor or a body of a positive number would be none.
    low, high = _LEAST * value if value >= 0 and last in _POSITIVE else -np.inf, np.inf
    if limits:
        low, high = _limits(text, limits)
        if not low <= value <= high:
            raise InputError(f"{path} begins at {value:g}, outside {limits}; change the scene")
        with named(text):  # a fit may end at a limit
            for limit in filter(np.isfinite, (low, high)):
                numbers.scene({path: limit})
    # A number that is 0 has no size of its own.
    size = abs(value) or (0.01 * radius if unit == "m" else 0.01)
    if unit == "m" and last in "xyz":
        size = max(size, 0.1 * radius)
    return Unknown(path, value, size, unit, low=low, high=high)


def _limits(text: str, limits: str) -> tuple[float, float]:
    try:
        low, high = map(float, limits.split(":"))
    except ValueError:
        raise InputError(f"{text!r}: limits are two numbers, as in frame.kv=0.1:0.8") from None
    if not low < high:
        raise InputError(f"{text!r}: the first limit must be below the second")
    return low, high


def _of_body(numbers: Numbers, name: str, radius: float) -> Iterator[Unknown]:
    paths = [f"{name}.mass", *(f"{name}.centre.{axis}" for axis in "xyz")]
    paths += [f"{name}{WHOLE}.{which}" for which in _MOMENTS]
    known = [numbers.known[path] for path in paths]
    values = np.array([each.value for each in known])
    mass, centre, moments = values[0], values[1:4], np.sqrt(values[[4, 7, 9]])
    sizes = [mass, *np.maximum(np.abs(centre), 0.1 * radius), *np.outer(moments, moments)[_UPPER]]
    try:
        _other_inertia(values, np.zeros(len(paths)))
    except np.linalg.LinAlgError:
        raise InputError(
            f"{name}{WHOLE}: no body of any thickness has the mass and inertia from which the fit "
            "begins; each moment must be less than the two others together"
        ) from None
    for path, (value, unit, _), size in zip(paths, known, sizes, strict=True):
        yield Unknown(path, value, float(size), unit, whole=True)


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


def of_log(scene: Scene, log: Log, at: int, freed: Sequence[str]) -> Iterator[Unknown]:
    """Yield the unknowns of a log: its start, and the circumstances that are freed."""
    sensors = {each.name: each for each in log.sensors}
    own = partial(Unknown, log=at, of=f"{log.name}: ")
    for axis in "xyz":
        yield own(f"start.turn.{axis}", 0.0, 0.1, "rad")
    for axis in "xy" if scene.rolling == "rubber" else "xyz":
        yield own(f"start.momentum.{axis}", 0.0, 0.1 * scene.momentum_scale, "kg m²/s")
    for hinge in scene.hinges:
        if hinge.motor is not None:
            yield own(f"start.{hinge.name}_angle", hinge.angle, 0.1, "rad")
            yield own(f"start.{hinge.name}_rate", hinge.rate, 0.1, "rad/s")
    if "position" in sensors and "world.origin" not in freed:
        place = np.median(sensors["position"].values[:FIRST, :2], axis=0)
        for axis, value in zip("xy", place.tolist(), strict=True):
            yield own(f"start.place.{axis}", value, 0.1 * scene.ball.radius, "m", moves=False)
    for name in dict.fromkeys(freed):
        yield from of_circumstance(scene, log, at, name)


def of_circumstance(scene: Scene, log: Log, at: int, name: str) -> Iterator[Unknown]:
    """Yield the unknowns of a circumstance of a log. Raises InputError for an unknown name."""
    radius = scene.ball.radius
    sizes = {"rad": 0.1, "m": 0.1 * radius, "rad/s": 0.1, "m/s²": 0.1, "s": 0.01, "1": 0.1}
    known = circumstance(name, [each.name for each in log.sensors])
    for axis in "xyz"[: known.count]:
        yield Unknown(
            f"{name}.{axis}" if known.count > 1 else name, 0.0, sizes[known.unit], known.unit,
            log=at, of=f"{log.name}: ", moves=not is_of_readings(name),
            low=0.0 if name == "commands.delay" else -np.inf,
        )  # fmt: skip


class Residuals:
    """The residuals of logs as a function of the unknowns, which are given in their sizes.

    fixed: other numbers of the scene that are not those of its file.
    """

    def __init__(
        self,
        numbers: Numbers,
        unknowns: Sequence[Unknown],
        logs: Sequence[FittedLog],
        run: Run,
        loss: str,
        fixed: Mapping[str, float],
    ) -> None:
        self.numbers, self.unknowns, self.logs, self.run = numbers, unknowns, logs, run
        self.loss, self.fixed = loss, fixed
        self._motion = lru_cache(maxsize=2 * len(logs) + 2)(self._moved)
        # Most unknowns belong to a log's start: one scene of the shared numbers serves many.
        self._shared_scene = lru_cache(maxsize=2)(
            lambda shared: numbers.scene({**fixed, **dict(shared)})
        )
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

    def ended(self, values: Array) -> list[Unknown]:
        """Return the unknowns with their values and sizes as they are where the fit ends."""
        return [
            replace(u, value=v, size=max(abs(v), u.size / 2) if u.size == abs(u.value) else u.size)
            for u, v in zip(self.unknowns, values.tolist(), strict=True)
        ]

    def slopes(self, x: Array, sized: Sequence[Unknown]) -> Array:
        """Return the derivative (p, p) of the values, in such sizes."""
        steps = _DIFFERENCE * np.eye(len(x))
        columns = [self.values(x + step) - self.values(x - step) for step in steps]
        return np.array(columns).T / (2 * _DIFFERENCE) / [[u.size] for u in sized]

    def scene(self, k: int, values: Array) -> Scene:
        """Return the scene of a log. Raises InputError for impossible numbers."""
        own = {u.name: v for u, v in zip(self.unknowns, values, strict=True) if u.log == k}
        known = zip(self.unknowns, values.tolist(), strict=True)
        shared = tuple((u.name, v) for u, v in known if u.log is None)
        began, log = self.logs[k].start, self.logs[k].log
        scene = self._shared_scene(shared)
        late = own.get("commands.delay", 0.0)
        commands = {name: held(t + late, values) for name, (t, values) in log.commands.items()}
        moved = [hinge.name for hinge in scene.hinges if hinge.motor is not None]
        hung = {hinge.name for hinge in scene.hinges}
        scene = scene.with_hinges(
            angle={name: own[f"start.{name}_angle"] for name in moved},
            rate={name: own[f"start.{name}_rate"] for name in moved},
            command={name: command for name, command in commands.items() if name in hung},
        )
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
        """Return the start and the circumstances of a log by their names."""
        found: dict[str, list[float]] = {}
        for u, v in zip(self.unknowns, values, strict=True):
            if u.log == k:
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
            return np.full(self.logs[k].count, np.inf)
        return self._weighed(k, found)

    def _weighed(self, k: int, found: list[Array]) -> Array:
        weighted = zip(found, self.logs[k].noise, strict=True)
        return self.counted(np.concatenate([(each / noise).ravel() for each, noise in weighted]))

    def counted(self, left: Array) -> Array:
        """Return residuals whose squares are what the loss makes of those of others."""
        return np.copysign(np.sqrt(LOSSES[self.loss](left**2)), left)

    def _by_motion(self, k: int, at: tuple[float, ...]) -> dict[int, Array]:
        """Return the derivatives (n,) of a log's residuals by unknowns that change its motion.

        Not by those that change the times of breakpoints and readings; by none of a run by an
        engine, nor of a scene with a controller.
        """
        from robotball.theory.multibody.integration import integrate_together  # which loads numba

        if self.run is not by_equations:
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
        parts = []
        for k, each in enumerate(self.logs):
            known, part = self._derivatives(k, tuple(x.tolist())), np.zeros((each.count, len(x)))
            for j in self._of[k]:
                part[:, j] = known[j] if j in known else self._by_differences(k, x, j, central)
            parts.append(part)
        return np.concatenate(parts)

    def _by_differences(self, k: int, x: Array, j: int, central: bool = True) -> Array:
        """Return the derivative (n,) of a log's residuals by one unknown; 0 for no motion."""
        before = self._part(k, x)
        sides = [
            (self._part(k, x + step * (np.arange(len(x)) == j)) - before) / step
            for step in (_DIFFERENCE, -_DIFFERENCE)[: 2 if central else 1]
        ]
        possible = [each for each in sides if np.isfinite(each).all()]
        return np.asarray(np.mean(possible, axis=0)) if possible else np.zeros(len(before))

    def of_others(self, x: Array, others: Sequence[Unknown]) -> Array:
        """Return the derivative (n, m) of the residuals by unknowns that are not sought."""
        unknowns = [*self.unknowns, *others]
        wider = Residuals(self.numbers, unknowns, self.logs, self.run, self.loss, self.fixed)
        derivative = np.zeros((sum(each.count for each in self.logs), len(others)))
        ends = np.cumsum([0, *(each.count for each in self.logs)])
        at = np.concatenate([x, np.zeros(len(others))])
        for i, each in enumerate(others):
            assert each.log is not None  # circumstances are of one log
            rows = slice(ends[each.log], ends[each.log + 1])
            derivative[rows, i] = wider._by_differences(each.log, at, len(x) + i)
        return derivative


def held(times: Array, values: Array) -> HeldCommand:
    """Return a log's commands as a drive, each held until the next that differs."""
    changes = np.flatnonzero(np.diff(values)) + 1
    command = HeldCommand(Constant(float(values[0])))
    for t, value in zip(times[changes].tolist(), values[changes].tolist(), strict=True):
        command.hold(t, Constant(value))
    command.breakpoints = tuple(command.times)
    return command


def by_equations(scene: Scene, times: Array) -> Motion:
    """Return the motion of a scene at times (n,) [s], as exactly as a fit needs.

    Raises InputError where `integrate` does, and for a motion that takes too many steps.
    """
    return integrate(scene, times, _RTOL, int(_MOST_STEPS * (1 + times[-1])))
