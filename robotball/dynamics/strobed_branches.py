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
from itertools import cycle

import numpy as np
from msgspec.structs import replace as changed

from robotball.dynamics import continuation as co
from robotball.dynamics.cycles import Cycle
from robotball.dynamics.equilibria import attitude_at
from robotball.dynamics.families import momentum_across
from robotball.dynamics.motion_branches import Range, sought
from robotball.dynamics.sections import own_start, period_of, strobed
from robotball.errors import InputError, unknown
from robotball.motion import Motion
from robotball.robot.drives import Constant, Drive, Sine, Total
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix, tangents
from robotball.theory.multibody.integration import integrate_together

_FIELDS = ("value", "mean", "amplitude", "phase")
_SETTLED = 30  # periods after which a motion that is attracted is near what attracts it
_INSIDE = 3  # values within the range at which motions are sought, in some twenty seconds each
_MOST = 4  # periods of the drives, to which motions are followed over period doublings if not told
_SIZE = 3e-6  # of differences, whose own error and that of rounding are equal about here
_NEUTRAL = 1e-6  # of their errors: of a multiplier's logarithm a real part below it is zero
# The error of a step, and of the map from which Newton's method leaves none: what is left is the
# product with an error of the derivative. Multipliers err by 3e-10, and by 1e-7 where solutions are
# sought alone. An error e moves a branch point by e^(2/3): it breaks the symmetry that makes one.
_CLOSED, _SOUGHT = (1e-11, 1e-9), (1e-7, 1e-6)
_LONGEST = 0.1  # of a step along a branch, as a point costs a hundred times one of what rests
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


def _with_number(scene: Scene, name: str, value: float) -> Scene:
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
    """A periodic scene whose number `name` goes from low to high as s goes from 0 to 1.

    longest: the period beyond which no motion is followed [s], four of the drives' if None.
    """

    scene: Scene
    name: str
    low: float
    high: float
    longest: float | None = None

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
        return _with_number(self.scene, self.name, self.value(s)), self.scene.momentum_scale

    @cached_property
    def _headed(self) -> bool:
        """Whether a heading matters, at some s."""
        return not all(self.at(s)[0].level for s in (0.0, 0.5, 1.0))

    def state(self, v: Array, scene: Scene) -> tuple[Array, Array]:
        """Return attitudes (..., 4), world momenta (..., 3) of points that v (..., n) are near."""
        gamma, mu, *alpha = np.moveaxis(v.reshape(*v.shape[:-1], -1, 3), -2, 0)
        gamma = gamma / np.linalg.norm(gamma, axis=-1, keepdims=True)
        first = tangents(gamma)[..., 0, :]
        for each in alpha:
            first = each - (each * gamma).sum(axis=-1, keepdims=True) * gamma
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
        """Return γ, M over its unit and, where a heading matters, α: (..., n)."""
        axes = rotation_matrix(attitude)
        M = np.einsum("...i,...ij->...j", momentum, axes) / self.scene.momentum_scale
        of = [axes[..., 2, :], M, axes[..., 0, :]]
        return np.concatenate(of if self._headed else of[:2], axis=-1)

    def return_error(self, x: Array, engine: Callable[[Scene, Array], Motion]) -> float:
        """Return how far an engine's motion from a point (n + 2,) is from it after the period.

        That is the largest difference of γ, of M over its unit and, where a heading matters, of α.
        engine: gives a scene's motion at times (m,) [s].
        """
        scene = self.at(x[-1])[0]
        attitude, M = self.state(x[:-2], scene)
        motion = engine(
            replace(scene, start=own_start(scene, attitude, M)), np.array([0.0, np.exp(x[-2])])
        )
        end = multiply(motion.attitude[-1], scene.principal_quaternion)
        moved = self.vector(end, motion.momentum[-1]) - self.vector(attitude, M)
        return float(np.abs(moved).max())

    def problem(
        self, errors: tuple[float, float] = _CLOSED, watch: co.Watch = co.SILENT
    ) -> co.Problem:
        """Return the problem of its fixed points; errors: of a step of the motions, of the map."""
        step, closed = errors

        def ends(parts: Sequence[tuple[Array, Scene]], periods: int) -> Array:
            """Return the points (m, n) some periods after starts (k, n) in each of the scenes.

            By the same steps, whose errors differences between the ends do not have.
            """
            begun = []
            for starts, scene in parts:
                states = zip(*self.state(starts, scene), strict=True)
                begun += [replace(scene, start=own_start(scene, q, M)) for q, M in states]
            durations = [periods * period_of(scene) for scene in begun]
            times = np.unique([0.0, *durations])
            motions = integrate_together(begun, times, step)
            at = [*zip(motions, np.searchsorted(times, durations), strict=True)]
            attitudes = np.array([motion.attitude[i] for motion, i in at])
            momenta = np.array([motion.momentum[i] for motion, i in at])
            return self.vector(multiply(attitudes, self.scene.principal_quaternion), momenta)

        def look(u: Array, s: float) -> co.Look:
            v, n, scene = u[:-1], len(u) - 1, self.at(s)[0]
            sides = v + _SIZE * np.concatenate([np.eye(n), -np.eye(n)])
            near = self.vector(*self.state(sides, scene))
            # Of the ways in which a point is free an orthonormal basis.
            basis, sizes, _ = np.linalg.svd((near[:n] - near[n:]).T)
            basis = basis[:, sizes > _SIZE]
            beside = [self.at(s + h)[0] for h in (_SIZE, -_SIZE)]
            periods = max(1, round(np.exp(u[-1]) / period_of(scene)))
            ways = _SIZE * np.concatenate([basis.T, -basis.T])
            parts = [(np.vstack([v, v + ways]), scene), *((v[None], each) for each in beside)]
            end, *moved, later, sooner = ends(parts, periods)
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
    """Return the logarithms (k,) of the eigenvalues, without real parts that are differences'."""
    found = np.log(np.linalg.eigvals(matrix).astype(complex) + _TINY)
    found.real[np.abs(found.real) < _NEUTRAL] = 0.0
    return np.asarray(found)


def swinging(family: Driven, watch: co.Watch = co.SILENT) -> Iterator[co.Branch]:
    """Yield the branches of periodic motions, and what crosses them.

    They are sought at the family's places, `_INSIDE` between: from the scene's start, from where
    its motion has settled and, where M may change, from rest about each principal axis, up at one
    place and down at the next.
    """
    rough, fine, branches = family.problem(_SOUGHT), family.problem(watch=watch), list[co.Branch]()
    sides = cycle(np.stack([np.eye(3), -np.eye(3)]))

    def found(scene: Scene, scale: float) -> Iterator[Array]:
        attitude = multiply(scene.start.attitude, scene.principal_quaternion)
        first, period = scene.start.momentum, np.log(period_of(scene))
        yield np.append(family.vector(attitude, first), period)
        if not scene.keeps_momentum:
            for v in family.vector(attitude_at(next(sides)), np.zeros((3, 3))):
                yield np.append(v, period)
        # The last, as a motion may be given up before it has settled.
        ends, M = strobed(scene, attitude[None], first[None], _SETTLED, _SOUGHT[0])
        yield np.append(family.vector(ends[0, -1], M[0, -1]), period)

    for some, s in sought(family, _INSIDE, found, watch):
        begun = (co.reached(rough, np.append(u, s), lost=watch.lost) for u in some)
        yield from co.explore(fine, (point.x for each in begun for point in each), branches)


def close_strobed(scene: Scene, attitude: Array, momentum: Array) -> Cycle:
    """Return the periodic motion near a start (4,), principal axes, and (3,), world.

    Raises InputError where Newton's method does not converge.
    """
    frequency = 1 / period_of(scene)
    family = Driven(scene, "frequency", frequency, frequency)
    x = np.array([*family.vector(attitude, momentum), -np.log(frequency), 0.0])
    point = co.corrected(family.problem(), x)
    values = np.exp(point.exponents)
    state = family.state(point.x[:-2], scene)
    return Cycle(*state, 1 / frequency, values[np.argsort(-np.abs(values))])
