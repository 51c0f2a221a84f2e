"""Orders of convergence: one contact model under every integrator, against two references.

Against the limit that the contact model itself tends to as steps shrink, an error is of the
integrator alone. Against the reduced equations it is that and the model's own: once steps are
short enough, what is left is the distance between the two limits. A contact model that rolls
truly has none, and the two errors are the same down to rounding.
"""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Literal

from robotball import Scene, Settings
from robotball.engines.mujoco.settings import ADAPTIVE
from robotball.rotations import Array
from validation.studies.order import Order, fit_order, stalled_at

# The order that theory claims for a smooth motion; of MuJoCo's, all that the MJCF knows.
MUJOCO_ORDERS = {"Euler": 1, "implicit": 1, "implicitfast": 1, "discrete": 1, "RK4": 4}
FIXED = f"{ADAPTIVE} fixed"
ORDERS = {**MUJOCO_ORDERS, FIXED: 8}

Reference = Literal["own", "equations"]
REFERENCES: tuple[Reference, ...] = ("own", "equations")


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
class Point:
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
class Limit:
    """The contact model's own limit: the run it is taken from, its path (n, 2) [m], how well it is
    known and how far it is from the equations, both over the path's length.
    """

    method: Method
    path: Array
    known_to: float
    model_error: float


@dataclass(frozen=True)
class Convergence:
    """All runs of one contact model, those of one integrator together, the longest step first."""

    scene: Scene
    settings: Settings
    duration: float
    limit: Limit
    points: tuple[Point, ...]

    @cached_property
    def by_name(self) -> dict[str, list[Point]]:
        """The points of each integrator."""
        names = dict.fromkeys(point.method.name for point in self.points)
        return {name: [p for p in self.points if p.method.name == name] for name in names}

    def order(self, name: str, against: Reference) -> Order | None:
        """The power of the step, or of the tolerance of DOP853, with which its errors fall."""
        known_to = self.limit.known_to if against == "own" else 0.0
        return fit_order(*self._series(name, against), known_to)

    def stalled_at(self, name: str, against: Reference) -> float | None:
        """The error at which an integrator's errors stop falling, if they do."""
        return stalled_at(*self._series(name, against))

    def _series(self, name: str, against: Reference) -> tuple[list[float], list[float | None]]:
        points = self.by_name[name]
        return [point.method.size for point in points], [point.error(against) for point in points]

    def rows(self) -> list[dict[str, Any]]:
        """A row of plain numbers for every run."""
        return [
            {
                "integrator": point.method.name,
                "step": point.step,
                "rtol": point.method.rtol if point.method.step is None else None,
                "own_error": point.own,
                "richardson": point.richardson,
                "equations_error": point.equations,
            }
            for point in self.points
        ]

    def record(self) -> dict[str, Any]:
        """The study as plain data; an order or a stall that there is not is None."""
        settings = asdict(self.settings).items()
        orders = {
            name: {
                against: {
                    "order": asdict(order) if (order := self.order(name, against)) else None,
                    "stalled_at": self.stalled_at(name, against),
                }
                for against in REFERENCES
            }
            for name in self.by_name
        }
        return {
            "scene": self.scene.name,
            "settings": {name: value for name, value in settings if value is not None},
            "duration": self.duration,
            "limit": {
                "by": str(self.limit.method),
                "known_to": self.limit.known_to,
                "model_error": self.limit.model_error,
            },
            "orders": orders,
            "runs": self.rows(),
        }
