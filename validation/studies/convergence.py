"""Orders of convergence: one contact model under every integrator, against two references.

Against the limit that the contact model itself tends to as steps shrink, an error is of the
integrator alone. Against the reduced equations it is that and the model's own: once steps are
short enough, what is left is the distance between the two limits. A contact model that rolls
truly has none, and the two errors are the same down to rounding.

A run changes nothing but integrator and step. MuJoCo guards soft contacts in silence (refsafe): it
raises solref's time constant to two steps. Steps that long are left out, as the contact would no
longer be the same. Steps end on the sample times: MuJoCo's are fractions of the sample interval.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import mujoco
import numpy as np

from robotball import ContactMotion, InputError, Motion, Scene, Settings, integrate
from robotball.engines.dop853 import LEAST_RTOL
from robotball.engines.mujoco.integrators import ADAPTIVE, INTEGRATORS, OWN
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import MOST_STEPS
from robotball.motion import path_error
from robotball.rotations import Array
from validation.studies.order import Order, fit_order, stalled_at

FIXED = f"{ADAPTIVE} fixed"
# The order that theory claims for a smooth motion.
ORDERS = {name: INTEGRATORS[name].order for name in OWN} | {FIXED: INTEGRATORS[ADAPTIVE].order}

Reference = Literal["own", "equations"]
REFERENCES: tuple[Reference, ...] = ("own", "equations")

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


@dataclass(frozen=True)
class Method:
    """An integrator at a step [s], or at a tolerance with the steps that it takes to keep it."""

    integrator: str
    step: float | None = None
    rtol: float | None = None

    @property
    def name(self) -> str:
        """The integrator's, by which runs at many steps belong together."""
        if self.integrator != ADAPTIVE:
            return self.integrator
        return ADAPTIVE if self.step is None else FIXED

    @property
    def size(self) -> float:
        """The step [s], or else the tolerance."""
        size = self.rtol if self.step is None else self.step
        assert size is not None
        return size

    def __str__(self) -> str:
        size = f"rtol {self.rtol:g}" if self.step is None else f"step {self.step * 1e3:.3g} ms"
        return f"{self.name}, {size}"


@dataclass(frozen=True)
class Trial:
    """One run: path errors over the path's length, None if it did not come to its end.

    step: s, the mean step of a run that chooses its own. own: against the contact model's own
    limit; equations: against the reduced equations; richardson: what the run at the next longer
    step says of `own`, without either reference.
    """

    method: Method
    step: float | None
    own: float | None = None
    equations: float | None = None
    richardson: float | None = None

    def error(self, against: Reference) -> float | None:
        return self.own if against == "own" else self.equations


@dataclass(frozen=True)
class OwnLimit:
    """The limit that the contact model tends to: the run it is taken from, how well it is known and
    how far it is from the equations, both over the path's length.
    """

    method: Method
    motion: Motion
    known_to: float
    model_error: float


@dataclass(frozen=True)
class Convergence:
    """All runs of one contact model, those of one integrator together, the longest step first."""

    scene: Scene
    settings: Settings
    duration: float
    limit: OwnLimit
    trials: tuple[Trial, ...]

    @cached_property
    def by_name(self) -> dict[str, list[Trial]]:
        """The trials of each integrator."""
        names = dict.fromkeys(trial.method.name for trial in self.trials)
        return {name: [p for p in self.trials if p.method.name == name] for name in names}

    def order(self, name: str, against: Reference) -> Order | None:
        """The power of the step, or of the tolerance of DOP853, with which its errors fall."""
        known_to = self.limit.known_to if against == "own" else 0.0
        return fit_order(*self._series(name, against), known_to)

    def stalled_at(self, name: str, against: Reference) -> float | None:
        """The error at which an integrator's errors stop falling, if they do."""
        return stalled_at(*self._series(name, against))

    def _series(self, name: str, against: Reference) -> tuple[list[float], list[float | None]]:
        trials = self.by_name[name]
        return [trial.method.size for trial in trials], [trial.error(against) for trial in trials]


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
    trials = [
        _trial(runs, limit, before, method)
        for before, method in zip([None, *methods[:-1]], methods, strict=True)
    ]
    return Convergence(scene, settings, float(theory.times[-1]), limit, tuple(trials))


def _methods(model: Model, interval: float, halvings: int) -> list[Method]:
    """All integrators at all steps and tolerances, the longest step of each first."""
    timeconst = float(model.compiled.pair_solref[0, 0])
    guarded = timeconst / 2 if timeconst > 0 else np.inf
    steps = [interval / 2**n for n in range(halvings)]
    allowed = [step for step in steps if step <= guarded * (1 + 1e-9)]
    count = int(np.log2(LONGEST / SHORTEST) * 2) + 1
    return [
        *(Method(name, step) for name in OWN for step in allowed),
        *(Method(ADAPTIVE, LONGEST / 2 ** (n / 2), ANY) for n in range(count)),
        *(Method(ADAPTIVE, None, rtol) for rtol in TOLERANCES),
    ]


@dataclass(frozen=True)
class _Run:
    """A run that came to its end, and its step [s], the mean if it chose them."""

    motion: ContactMotion
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
        mean = float(times[-1]) / motion.report.steps
        return _Run(motion, method.step or mean)


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


def _limit(runs: _Runs, finest: Method) -> OwnLimit:
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
            known_to = path_error(near.motion, best.motion)
            off = path_error(best.motion, runs.theory)
            return OwnLimit(method, best.motion, known_to, off)
    raise InputError(
        f"{runs.model.scene.name}: the contact model breaks off even at steps of "
        f"{finest.step:g} s; there is no limit to converge to"
    )


def _trial(runs: _Runs, limit: OwnLimit, before: Method | None, method: Method) -> Trial:
    """The run of a method set against both references, and against the one before it."""
    found = runs.of(method)
    if found is None:
        return Trial(method, method.step)
    estimate = None
    if before is not None and before.name == method.name and method.name in ORDERS:
        longer = runs.of(before)
        if longer is not None:
            fall = (longer.step / found.step) ** ORDERS[method.name]
            estimate = path_error(longer.motion, found.motion) / (fall - 1)
    return Trial(
        method,
        found.step,
        path_error(found.motion, limit.motion),
        path_error(found.motion, runs.theory),
        estimate,
    )
