"""Branches of periodic motions of a periodically driven scene as one number of it varies.

The motions are fixed points of the stroboscopic map. A state is γ and scaled M in principal axes,
and α if the plane is not level (otherwise the heading has no effect). The map first projects a
vector (n,) onto a valid state, so the map has n coordinates. The map's derivative is computed from
differences, and its rank is the number of degrees of freedom of the state. The last unknown is ln
T: the period T is the drives' period, doubled at each period doubling.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle, product

import numpy as np
from msgspec.structs import replace as changed

from robotball.dynamics import continuation as co
from robotball.dynamics.equilibria import attitude_at
from robotball.dynamics.motion_branches import Range, momentum_across, sought
from robotball.dynamics.sections import own_start, period_of, strobed
from robotball.errors import InputError, unknown
from robotball.robot.drives import Constant, Drive, Sine, Total
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix, tangents
from robotball.theory.multibody.integration import integrate_together

_FIELDS = ("value", "mean", "amplitude", "phase")
_SETTLED = 30  # periods after which a motion has come close to its attractor
_INSIDE = 3  # interior values of the range at which motions are searched for, about 20 s each
_MOST = 4  # default limit of the period, in periods of the drives
_SIZE = 3e-6  # of differences: truncation and rounding errors are about equal
_NEUTRAL = 1e-6  # error of differences: a smaller real part of a multiplier's logarithm is zero
# (error of a step, residual of the map at which Newton's method stops). The residual that remains
# is the step times the error of the derivative. Multipliers are accurate to 3e-10, and to 1e-7
# during the search. An error e breaks the symmetry behind a branch point and moves the point by
# e^(2/3).
_CLOSED, _SOUGHT = (1e-11, 1e-9), (1e-7, 1e-6)
_LONGEST = 0.1  # step along a branch; a point takes a hundred times as long as an equilibrium
_TINY = 1e-300  # added to multipliers, which may be zero


def _driven(scene: Scene) -> dict[str, Drive]:
    plane = {f"plane.{axis}": d for axis, d in zip("XYZ", scene.plane_drives, strict=True)}
    return {hinge.name: hinge.command for hinge in scene.hinges} | plane


def numbers_of(scene: Scene) -> dict[str, float]:
    """Return the scene's numbers that a branch can follow, such as "frequency", "frame.mean".

    The numbers include f and c if the scene conserves M. Raises InputError if the scene is not
    periodic.
    """
    M = scene.start.momentum
    level = {"f": float(M @ M), "c": float(M[2])} if scene.keeps_momentum else {}
    keys = product(_driven(scene).items(), _FIELDS)
    numbers = {f"{name}.{key}": getattr(d, key) for (name, d), key in keys if hasattr(d, key)}
    return {"frequency": 1 / period_of(scene), **level, **numbers}


def _with_number(scene: Scene, name: str, value: float) -> Scene:
    """Return the scene with one of its numbers changed; the frequency scales all sines."""

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
        drives = {hinge: faster(drive) for hinge, drive in drives.items()}
    elif isinstance(drive := drives[owner], Sine):
        drives[owner] = changed(drive, **{key: value})
    else:
        drives[owner] = Constant(value)
    *commands, X, Y, Z = drives.values()
    varied = replace(scene.with_hinges(command=commands), plane_motion=(X, Y, Z))
    if name == "frequency" and abs(value * period_of(varied) - 1) > _SIZE:
        raise InputError(
            f"{scene.name}: full turns of a hinge set the period: vary the mean rate of that hinge"
        )
    return varied


@dataclass(frozen=True)
class Driven(Range):
    """A periodic scene whose number `name` varies from low to high as s goes from 0 to 1.

    longest: limit of the period [s], by default four periods of the drives.
    """

    scene: Scene
    name: str
    low: float
    high: float
    longest: float | None = None

    @property
    def label(self) -> tuple[str, str]:
        """Symbol and unit of the number."""
        key = self.name.rpartition(".")[2]
        units = {"frequency": "Hz", "phase": "rad", "f": "(kg m²/s)²", "c": "kg m²/s"}
        return self.name, units.get(key, "m/s²" if self.name.startswith("plane") else "rad/s")

    @property
    def nominal(self) -> float:
        """The unmodified scene's value of the number."""
        return numbers_of(self.scene)[self.name]

    def at(self, s: float) -> tuple[Scene, float]:
        """Return the scene at s, and the unit of M [kg m²/s], which does not depend on s."""
        return _with_number(self.scene, self.name, self.value(s)), self.scene.momentum_scale

    @cached_property
    def _headed(self) -> bool:
        """Whether the heading has an effect, because the plane is not level, at some s."""
        return not all(self.at(s)[0].level for s in (0.0, 0.5, 1.0))

    def state(self, v: Array, scene: Scene) -> tuple[Array, Array]:
        """Return the attitudes (..., 4) and world momenta (..., 3) nearest to v (..., n)."""
        gamma, mu, *alpha = np.moveaxis(v.reshape(*v.shape[:-1], -1, 3), -2, 0)
        gamma = gamma / np.linalg.norm(gamma, axis=-1, keepdims=True)
        first = tangents(gamma)[..., 0, :]
        for direction in alpha:
            first = direction - (direction * gamma).sum(axis=-1, keepdims=True) * gamma
            first /= np.linalg.norm(first, axis=-1, keepdims=True)
        axes = np.stack([first, np.cross(gamma, first), gamma], axis=-2)
        M = self.scene.momentum_scale * np.einsum("...ij,...j->...i", axes, mu)
        if scene.keeps_momentum:
            kept = scene.start.momentum
            length = np.linalg.norm(M[..., :2], axis=-1, keepdims=True)
            M[..., :2] *= np.hypot(*kept[:2]) / np.where(length > 0, length, 1.0)
            M[..., 2] = kept[2]
        return from_matrix(axes), M * ([1.0, 1.0, 0.0] if scene.rolling == "rubber" else 1.0)

    def vector(self, attitude: Array, momentum: Array) -> Array:
        """Return γ, scaled M and, if the heading has an effect, α, as one vector (..., n)."""
        axes = rotation_matrix(attitude)
        M = np.einsum("...i,...ij->...j", momentum, axes) / self.scene.momentum_scale
        vectors = [axes[..., 2, :], M, axes[..., 0, :]]
        return np.concatenate(vectors if self._headed else vectors[:2], axis=-1)

    def problem(
        self, errors: tuple[float, float] = _CLOSED, watch: co.Watch = co.SILENT
    ) -> co.Problem:
        """Return the problem of the fixed points; errors: (error of a step, residual)."""
        step, closed = errors

        def ends_of(parts: Sequence[tuple[Array, Scene]], periods: int) -> Array:
            """Return the states (m, n) some periods after starts (k, n) in each of the scenes.

            All motions take the same steps, so that step errors cancel in differences.
            """
            scenes = []
            for starts, scene in parts:
                states = zip(*self.state(starts, scene), strict=True)
                scenes += [replace(scene, start=own_start(scene, q, M)) for q, M in states]
            durations = [periods * period_of(scene) for scene in scenes]
            times = np.unique([0.0, *durations])
            motions = integrate_together(scenes, times, step)
            ends = [*zip(motions, np.searchsorted(times, durations), strict=True)]
            attitudes = np.array([motion.attitude[i] for motion, i in ends])
            momenta = np.array([motion.momentum[i] for motion, i in ends])
            return self.vector(multiply(attitudes, self.scene.principal_quaternion), momenta)

        def look(u: Array, s: float) -> co.Linearization:
            v, n, scene = u[:-1], len(u) - 1, self.at(s)[0]
            sides = v + _SIZE * np.concatenate([np.eye(n), -np.eye(n)])
            near = self.vector(*self.state(sides, scene))
            # Orthonormal basis of the directions in which the state is free.
            basis, sizes, _ = np.linalg.svd((near[:n] - near[n:]).T)
            basis = basis[:, sizes > _SIZE]
            beside = [self.at(s + h)[0] for h in (_SIZE, -_SIZE)]
            periods = max(1, round(np.exp(u[-1]) / period_of(scene)))
            steps = _SIZE * np.concatenate([basis.T, -basis.T])
            neighbours = [(v[None], neighbour) for neighbour in beside]
            parts = [(np.vstack([v, v + steps]), scene), *neighbours]
            end, *moved, later, sooner = ends_of(parts, periods)
            ahead, behind = np.split(np.array(moved), 2)
            images = (ahead - behind).T / (2 * _SIZE)
            jacobian = np.zeros((n + 1, n + 2))
            jacobian[:n, :n] = images @ basis.T - np.eye(n)
            jacobian[:n, -1] = (later - sooner) / (2 * _SIZE)
            slower = np.log(period_of(beside[1]) / period_of(beside[0])) / (2 * _SIZE)
            jacobian[n, n:] = 1.0, slower
            gap = np.append(end - v, u[-1] - np.log(periods * period_of(scene)))
            return gap, jacobian, lambda: _logarithms(basis.T @ images)

        slowest = max(period_of(self.at(s)[0]) for s in (0.0, 1.0))
        longest = self.longest or _MOST * slowest

        def end(u: Array) -> str:
            return f"a period of more than {longest:.4g} s" if np.exp(u[-1]) > longest else ""

        return co.Problem(
            look, end=end, watch=watch, rank=_NEUTRAL, closed=closed, longest=_LONGEST
        )


def _logarithms(matrix: Array) -> Array:
    """Return the logarithms (k,) of the eigenvalues; real parts within their error are zero."""
    logarithms = np.log(np.linalg.eigvals(matrix).astype(complex) + _TINY)
    logarithms.real[np.abs(logarithms.real) < _NEUTRAL] = 0.0
    return np.asarray(logarithms)


def swinging(family: Driven, watch: co.Watch = co.SILENT) -> Iterator[co.Branch]:
    """Yield the branches of periodic motions, and the branches that cross them.

    At each searched s, Newton's method starts from the scene's start, from the state after 30
    periods and, if M may change, from rest with each principal axis vertical, alternately up and
    down.
    """
    rough, fine, branches = family.problem(_SOUGHT), family.problem(watch=watch), list[co.Branch]()
    sides = cycle(np.stack([np.eye(3), -np.eye(3)]))

    def starts_of(scene: Scene, scale: float) -> Iterator[Array]:
        attitude = multiply(scene.start.attitude, scene.principal_quaternion)
        first, period = scene.start.momentum, np.log(period_of(scene))
        yield np.append(family.vector(attitude, first), period)
        if not scene.keeps_momentum:
            for v in family.vector(attitude_at(next(sides)), np.zeros((3, 3))):
                yield np.append(v, period)
        # Last, because integrating to the attractor may fail.
        ends, M = strobed(scene, attitude[None], first[None], _SETTLED, _SOUGHT[0])
        yield np.append(family.vector(ends[0, -1], M[0, -1]), period)

    for starts, s in sought(family, _INSIDE, starts_of, watch):
        rough_points = (co.reached(rough, np.append(u, s), lost=watch.lost) for u in starts)
        refined = (point.x for points in rough_points for point in points)
        yield from co.explore(fine, refined, branches)
