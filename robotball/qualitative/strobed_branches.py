"""Branches of periodic motions of a scene that is driven periodically, in one number of it.

They are fixed points of the stroboscopic map, as cycles are of a section's. Its point is γ and M
over their scale, in principal axes, and where the plane is not level α too: else a heading changes
nothing. A vector (n,) near such a point is first put on it, so that the map has n coordinates, and
its derivative, by differences, the rank of the point's freedom. With them stands ln T, where the
period T is one of the drives', or two after a period doubling, and so on.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec.structs import replace as changed

from robotball.drives import Constant, Drive, Sine, Total
from robotball.engines.multibody import integrate_together
from robotball.errors import InputError, unknown
from robotball.qualitative import continuation as co
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import attitude_at
from robotball.qualitative.families import momentum_across
from robotball.qualitative.motion_branches import Range, Told, sought
from robotball.qualitative.sections import own_start, period_of, strobed
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix, tangents
from robotball.scene import Scene, Start

_FIELDS = ("value", "mean", "amplitude", "phase")
_SETTLED = 30  # periods after which a motion that is attracted is near what attracts it
_INSIDE = 3  # values within the range at which motions are sought, in some twenty seconds each
_MOST = 4  # periods of the drives, to which motions are followed over period doublings
_SIZE = 3e-6  # of differences, whose own error and that of rounding are equal about here
_NEUTRAL = 1e-6  # of their errors: of a multiplier's logarithm a real part below it is zero
_STEP = 1e-11  # the error of a step: with it multipliers err by 3e-10, and with 1e-8 by 1e-8
_CLOSED = 1e-9  # of the map: what is left is the product with an error of the derivative
_TINY = 1e-300  # beside a multiplier that is zero


def _driven(scene: Scene) -> dict[str, Drive]:
    """Return all that is driven, by its name: hinges, and the plane along three axes."""
    plane = {f"plane.{axis}": d for axis, d in zip("XYZ", scene.plane_drives, strict=True)}
    return {hinge.name: hinge.command for hinge in scene.hinges} | plane


def numbers_of(scene: Scene) -> dict[str, float]:
    """Return the numbers in which motions are followed, by name: "frequency", "frame.mean".

    f and c where the motion keeps them. Raises InputError where the scene is not periodic.
    """
    M = scene.start.momentum
    level = {"f": float(M @ M), "c": float(M[2])} if scene.keeps_momentum else {}
    return {"frequency": 1 / period_of(scene), **level} | {
        f"{name}.{key}": getattr(drive, key)
        for name, drive in _driven(scene).items() for key in _FIELDS if hasattr(drive, key)
    }  # fmt: skip


def with_number(scene: Scene, name: str, value: float) -> Scene:
    """Return the scene with one of its numbers changed.

    The frequency is that of all sines together. Raises InputError for an unknown name, and for a
    frequency where whole turns have a part in the period.
    """

    def faster(drive: Drive) -> Drive:
        if isinstance(drive, Total):
            return Total(tuple(map(faster, drive.drives)))
        if isinstance(drive, Sine):
            return changed(drive, frequency=value / numbers["frequency"] * drive.frequency)
        return drive

    drives, (owner, _, key) = _driven(scene), name.rpartition(".")
    if name not in (numbers := numbers_of(scene)):
        raise unknown("number", name, numbers)
    if name in ("f", "c"):
        level = {"f": numbers["f"], "c": numbers["c"], name: value}
        M = momentum_across(scene.rolling, scene.start.momentum, **level)
        return replace(scene, start=Start(scene.start.attitude, M))
    if name == "frequency":
        drives = {each: faster(drive) for each, drive in drives.items()}
    elif isinstance(drive := drives[owner], Sine):
        drives[owner] = changed(drive, **{key: value})
    else:
        drives[owner] = Constant(value)
    *commands, X, Y, Z = drives.values()
    varied = replace(scene.with_hinges(command=commands), plane_motion=(X, Y, Z))
    if name == "frequency" and abs(value * period_of(varied) - 1) > _SIZE:
        raise InputError(
            f"{scene.name}: whole turns are in its period; vary the rate that turns it"
        )
    return varied


@dataclass(frozen=True)
class Driven(Range):
    """A periodic scene whose number `name` goes from low to high as s goes from 0 to 1."""

    scene: Scene
    name: str
    low: float
    high: float

    @property
    def label(self) -> tuple[str, str]:
        """The number as it is written, and its unit."""
        key = self.name.rpartition(".")[2]
        units = {"frequency": "Hz", "phase": "rad", "f": "(kg m²/s)²", "c": "kg m²/s"}
        return self.name, units.get(key, "m/s²" if self.name.startswith("plane") else "rad/s")

    @property
    def own(self) -> float:
        """The scene's own number."""
        return numbers_of(self.scene)[self.name]

    def at(self, s: float) -> tuple[Scene, float]:
        """Return the scene at s, and the unit of M, which is the same at all s [kg m²/s]."""
        return with_number(self.scene, self.name, self.value(s)), self.scene.momentum_scale

    @cached_property
    def _headed(self) -> bool:
        """Whether a heading matters, at some s."""
        return not all(self.at(s)[0].level for s in (0.0, 0.5, 1.0))

    def state(self, v: Array, scene: Scene, scale: float) -> tuple[Array, Array]:
        """Return the attitude (4,) and the world momentum (3,) of the point that v (n,) is near."""
        gamma, mu, *alpha = v.reshape(-1, 3)
        gamma = gamma / np.linalg.norm(gamma)
        first = alpha[0] - (alpha[0] @ gamma) * gamma if alpha else tangents(gamma)[0]
        first = first / np.linalg.norm(first)
        axes = np.stack([first, np.cross(gamma, first), gamma])
        M = scale * axes @ mu
        if scene.keeps_momentum:
            kept = scene.start.momentum
            M[:2] *= np.hypot(*kept[:2]) / (np.hypot(*M[:2]) or 1.0)
            M[2] = kept[2]
        return from_matrix(axes), M * ([1.0, 1.0, 0.0] if scene.rolling == "rubber" else 1.0)

    def vector(self, attitude: Array, momentum: Array) -> Array:
        """Return γ, M over its unit and, where a heading matters, α: (n,)."""
        alpha, _, gamma = axes = rotation_matrix(attitude)
        of = [gamma, momentum @ axes / self.scene.momentum_scale, alpha]
        return np.concatenate(of if self._headed else of[:2])

    def problem(self, told: Told = lambda x: None) -> co.Problem:
        """Return the problem of its fixed points."""
        scale = self.scene.momentum_scale

        def ends(starts: Sequence[tuple[Array, Scene]], periods: int) -> Array:
            """Return the points (m, n) some periods of their scenes after starts.

            By the same steps, whose errors differences between the ends do not have.
            """
            begun = (self.state(v, scene, scale) for v, scene in starts)
            scenes = [
                replace(scene, start=own_start(scene, *start))
                for (_, scene), start in zip(starts, begun, strict=True)
            ]
            durations = [periods * period_of(scene) for scene in scenes]
            times = np.unique([0.0, *durations])
            found = []
            for motion, end in zip(
                integrate_together(scenes, times, _STEP), durations, strict=True
            ):
                i = np.searchsorted(times, end)
                q = multiply(motion.attitude[i], motion.scene.principal_quaternion)
                found.append(self.vector(q, motion.momentum[i]))
            return np.array(found)

        def look(u: Array, s: float) -> co.Look:
            v, n, scene = u[:-1], len(u) - 1, self.at(s)[0]
            periods = max(1, round(np.exp(u[-1]) / period_of(scene)))
            sides = v + _SIZE * np.concatenate([np.eye(n), -np.eye(n)])
            near = np.array([self.vector(*self.state(each, scene, scale)) for each in sides])
            # Of the ways in which a point is free an orthonormal basis.
            basis, sizes, _ = np.linalg.svd((near[:n] - near[n:]).T)
            basis = basis[:, sizes > _SIZE]
            beside = [self.at(s + h)[0] for h in (_SIZE, -_SIZE)]
            steps = _SIZE * np.concatenate([basis.T, -basis.T])
            starts = [(w, scene) for w in (v, *(v + steps))] + [(v, each) for each in beside]
            end, *moved = ends(starts, periods)
            T, later, sooner = (np.log(periods * period_of(each)) for each in (scene, *beside))
            k = basis.shape[1]
            order = [*range(k), 2 * k, *range(k, 2 * k), 2 * k + 1]
            ahead, behind = np.split(np.array(moved)[order], 2)
            images = (ahead - behind).T / (2 * _SIZE)
            jacobian = np.zeros((n + 1, n + 2))
            jacobian[:n, :n] = images[:, :-1] @ basis.T - np.eye(n)
            jacobian[:n, -1] = images[:, -1]
            jacobian[n, n:] = 1.0, (sooner - later) / (2 * _SIZE)
            residual = np.append(end - v, u[-1] - T)
            return residual, jacobian, lambda: _logarithms(basis.T @ images[:, :-1])

        longest = _MOST * max(period_of(self.at(s)[0]) for s in (0.0, 1.0))

        def end(u: Array) -> str:
            return f"more than {_MOST} periods of the drives" if np.exp(u[-1]) > longest else ""

        return co.Problem(look, end=end, told=told, rank=_NEUTRAL, closed=_CLOSED)


def _logarithms(matrix: Array) -> Array:
    """Return the logarithms (k,) of the eigenvalues, without real parts that are differences'."""
    found = np.log(np.linalg.eigvals(matrix).astype(complex) + _TINY)
    found.real[np.abs(found.real) < _NEUTRAL] = 0.0
    return np.asarray(found)


def swinging(
    family: Driven, told: Told, at: Callable[[float], None] = lambda s: None
) -> Iterator[co.Branch]:
    """Yield the branches of periodic motions, and what crosses them.

    They are sought at the family's places, `_INSIDE` between, which `at` is given: from the
    scene's start, from where its motion has settled, and from rest about each principal axis where
    M may change.
    """
    problem, branches = family.problem(told), list[co.Branch]()

    def found(scene: Scene, scale: float) -> Iterator[Array]:
        attitude = multiply(scene.start.attitude, scene.principal_quaternion)
        first = scene.start.momentum
        ends, M = strobed(scene, attitude[None], first[None], _SETTLED)
        starts = [family.vector(attitude, first), family.vector(ends[0, -1], M[0, -1])]
        if not scene.keeps_momentum:
            upright = attitude_at(np.concatenate([np.eye(3), -np.eye(3)]))
            starts += [family.vector(q, np.zeros(3)) for q in upright]
        for v in starts:
            yield np.append(v, np.log(period_of(scene)))

    for u, s in sought(family, _INSIDE, found, at):
        x = np.append(u, s)
        for point in co.reached(problem, x, np.eye(len(x))[-1]):
            for branch in co.explore(problem, [point.x], branches):
                branches.append(branch)
                yield branch


def close_strobed(scene: Scene, attitude: Array, momentum: Array) -> Cycle:
    """Return the periodic motion near a start (4,), principal axes, and (3,), world.

    Raises InputError where Newton's method does not converge.
    """
    frequency = 1 / period_of(scene)
    family = Driven(scene, "frequency", frequency, frequency)
    x = np.array([*family.vector(attitude, momentum), -np.log(frequency), 0.0])
    point = co.corrected(family.problem(), x, np.eye(len(x))[-1])
    values = np.exp(point.exponents)
    state = family.state(point.x[:-2], *family.at(0.0))
    return Cycle(*state, 1 / frequency, values[np.argsort(-np.abs(values))])
