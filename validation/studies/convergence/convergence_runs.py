"""The runs of a convergence study: one compiled model, many integrators and steps.

A run changes nothing but integrator and step. MuJoCo guards soft contacts in silence (refsafe): it
raises solref's time constant to two steps. Steps that long are left out, as the contact would no
longer be the same. Steps end on the sample times: MuJoCo's are fractions of the sample interval.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

from robotball import InputError, Motion, Scene, Settings, integrate
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import ADAPTIVE, LEAST_RTOL, MOST_STEPS
from robotball.rotations import Array
from validation.studies.convergence.convergence import (
    MUJOCO_ORDERS,
    ORDERS,
    Convergence,
    Limit,
    Method,
    Point,
)

Show = Callable[[float, str], None]

HALVINGS = 8  # of the sample interval, for MuJoCo's shortest step
LONGEST, SHORTEST = 0.24, 0.005  # s, steps of DOP853, in ratios of √2
TOLERANCES = tuple(10.0**-n for n in range(4, 15))  # of DOP853 with steps of its own
LIMITS = (
    LEAST_RTOL,
    1e-13,
    1e-11,
    1e-9,
)  # its tolerances for the limit: the first that comes to its end
ANY = 1.0  # a tolerance that lets every step pass
PATIENCE, LEAST_PATIENCE = 600, 64  # steps a second, and besides, before DOP853 is given up


def measure_convergence(
    scene: Scene,
    settings: Settings,
    times: Array | None = None,
    halvings: int = HALVINGS,
    show: Show | None = None,
) -> Convergence:
    """Every integrator at many steps on the contact model of `settings`.

    times: (n,) s, equally spaced from 0, the scene's own if None; halvings: of the sample interval,
    down to MuJoCo's shortest step; show: told the part that is done, 0 to 1, and what is done next.
    Raises InputError where the contact model breaks off however short the steps.
    """
    theory = integrate(scene, times)
    interval = float(theory.times[1])
    finest = Method("RK4", interval / 2**halvings)
    contact = replace(settings, stop_at_fault=False, max_steps=MOST_STEPS)
    model = build(scene, replace(contact, integrator="RK4", timestep=finest.step, rtol=None))
    methods = _methods(model, interval, halvings)
    runs = _Runs(model, theory, len(methods) + 1, show or (lambda part, what: None))
    limit = _limit(runs, finest)
    points = [
        _point(runs, limit, before, method)
        for before, method in zip([None, *methods[:-1]], methods, strict=True)
    ]
    return Convergence(scene, settings, float(theory.times[-1]), limit, tuple(points))


def _methods(model: Model, interval: float, halvings: int) -> list[Method]:
    """All integrators at all steps and tolerances, the longest step of each first."""
    timeconst = float(model.compiled.pair_solref[0, 0])
    guarded = timeconst / 2 if timeconst > 0 else np.inf
    steps = [interval / 2**n for n in range(halvings)]
    allowed = [step for step in steps if step <= guarded * (1 + 1e-9)]
    count = int(np.log2(LONGEST / SHORTEST) * 2) + 1
    return [
        *(Method(name, step) for name in MUJOCO_ORDERS for step in allowed),
        *(Method(ADAPTIVE, LONGEST / 2 ** (n / 2), ANY) for n in range(count)),
        *(Method(ADAPTIVE, None, rtol) for rtol in TOLERANCES),
    ]


@dataclass(frozen=True)
class _Run:
    """A run that came to its end: its path (n, 2) [m] and its mean step [s], if it chose them."""

    path: Array
    step: float


@dataclass
class _Runs:
    """Runs of one model, each made once, beside the motion by the equations."""

    model: Model
    theory: Motion
    total: int
    show: Show
    made: dict[Method, _Run | None] = field(default_factory=dict)

    def of(self, method: Method) -> _Run | None:
        """The run of a method; None if it broke off or would not end."""
        if method not in self.made:
            part = len(self.made) / self.total
            self.show(min(part, 1.0), f"{self.model.scene.name}: {method}")
            self.made[method] = self._run(method)
        return self.made[method]

    def _run(self, method: Method) -> _Run | None:
        times = self.theory.times
        with np.errstate(all="ignore"):  # a run that diverges says so itself
            motion = run(_stepped(self.model, method, float(times[-1])), times)
        if len(motion.times) < len(times):
            return None
        assert motion.diagnostics is not None
        mean = float(times[-1]) / motion.diagnostics.steps
        return _Run(motion.contact_point, method.step or mean)

    def distance(self, one: Array, other: Array) -> float:
        """The largest distance between two paths, over the length of the equations' path."""
        return float(np.linalg.norm(one - other, axis=1).max()) / self.theory.path_length


def _stepped(model: Model, method: Method, duration: float) -> Model:
    """The same MJCF, compiled afresh, under another integrator."""
    settings = replace(
        model.settings, integrator=method.integrator, timestep=method.step, rtol=method.rtol
    )
    if settings.adaptive:
        patience = LEAST_PATIENCE + int(PATIENCE * duration)
        return replace(model, settings=replace(settings, max_steps=patience))
    assert method.step is not None
    same = replace(model, settings=settings)
    member = f"mjINT_{method.integrator.upper()}"
    same.compiled.opt.integrator = getattr(mujoco.mjtIntegrator, member)
    same.compiled.opt.timestep = method.step
    return same


def _limit(runs: _Runs, finest: Method) -> Limit:
    """The limit of short steps: DOP853's where the motion is smooth enough, or else RK4's."""
    assert finest.step is not None
    # What ten times the tolerance, or twice the step, changes is more than what is still wrong.
    candidates = [
        *((Method(ADAPTIVE, None, rtol), Method(ADAPTIVE, None, 10 * rtol)) for rtol in LIMITS),
        (finest, replace(finest, step=2 * finest.step)),
    ]
    for method, coarser in candidates:
        best, near = runs.of(method), runs.of(coarser)
        if best is not None and near is not None:
            known_to = runs.distance(best.path, near.path)
            off = runs.distance(best.path, runs.theory.contact_point)
            return Limit(method, best.path, known_to, off)
    raise InputError(
        f"{runs.model.scene.name}: the contact model breaks off even at steps of "
        f"{finest.step:g} s; there is no limit to converge to"
    )


def _point(runs: _Runs, limit: Limit, before: Method | None, method: Method) -> Point:
    """The run of a method set against both references, and against the one before it."""
    found = runs.of(method)
    if found is None:
        return Point(method, method.step)
    estimate = None
    if before is not None and before.name == method.name and method.name in ORDERS:
        longer = runs.of(before)
        if longer is not None:
            fall = (longer.step / found.step) ** ORDERS[method.name]
            estimate = runs.distance(longer.path, found.path) / (fall - 1)
    return Point(
        method,
        found.step,
        runs.distance(found.path, limit.path),
        runs.distance(found.path, runs.theory.contact_point),
        estimate,
    )
