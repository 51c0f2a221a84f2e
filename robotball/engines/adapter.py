"""What the engines of other packages share: steps, what is read after them, and the report.

An adapter is a file: its settings, its presets, what it cannot express, and a World, which is the
ball made ready in that engine. The package is imported when a world is made, not before.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from robotball.engines.links import Readings, State, readings_of, state_of_rows
from robotball.engines.protocol import Engine, Progress, Request, as_own
from robotball.engines.spans import spans
from robotball.engines.worlds import World
from robotball.errors import InputError, warn
from robotball.faults import DIVERGED, RATE_ERROR, SHORTEST_PATH, Fault, FaultKind
from robotball.motion import ContactMotion, ContactReport, Label, Loads
from robotball.rotations import Array, Mask
from robotball.scene import Scene
from robotball.settings import EngineSettings

LIFTED = 0.01  # of the radius: a shell this far above the plane has left it


@dataclass(frozen=True, kw_only=True)
class StepSettings(EngineSettings):
    """Settings of an engine that takes equal steps [s]; each adapter adds its own."""

    timestep: float


class Adapter(Engine, ABC):
    """An engine of another package.

    package: what is imported; extra: the extra of ours that brings it; requirements: what that
    extra asks for; settings_type: of its settings.
    """

    package: str
    extra: str
    requirements: tuple[str, ...]
    settings_type: type[StepSettings]
    default = "best"
    least_accuracy: float | None = None
    presets: Mapping[str, StepSettings]

    @abstractmethod
    def world(self, scene: Scene, settings: StepSettings, step: float) -> World:
        """The ball at its start, for steps of this length [s]."""

    def limits(self, scene: Scene) -> str | None:
        """Why this engine in particular cannot roll the scene; None where it can."""
        return None

    def lacks(self, scene: Scene, settings: StepSettings) -> str | None:
        """What of the scene the engine has not under these settings, in a line, for a warning."""
        return None

    @property
    def installed(self) -> bool:
        """Whether its package is there; nothing is imported, but what a part's package is in."""
        return find_spec(self.package) is not None

    def cannot_express(self, scene: Scene) -> str | None:
        """What no adapter can, and then what this one cannot."""
        if scene.not_reduced:
            return (
                f"its adapter turns hinges at given rates in a balanced ball: {scene.not_reduced}"
            )
        if scene.ball.shell.offset:
            return "its adapter has the shell's centre of mass at the shell's centre"
        return self.limits(scene)

    def run(
        self,
        scene: Scene,
        times: Array,
        request: Request,
        *,
        loads: Loads | None = None,
        strict: bool = False,
        fault_window: Path | None = None,
        progress: Progress | None = None,
    ) -> ContactMotion:
        """The motion; of its loads nothing is known, and no fault window is kept."""
        settings = as_own(request.settings, self.settings_type, self.label)
        if not self.installed:
            raise InputError(
                f"{self.label.name} is not installed: pip install 'robotball[{self.extra}]', or "
                f"robotball engines --install {self.extra} for an environment of its own"
            )
        if lack := self.lacks(scene, settings):
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        world = self.world(scene, settings, longest_step(scene, times, settings.timestep))
        rows, spent = [world.now.row], 0.0
        march = world.march(times, settings.timestep)
        while len(rows) < len(times) and np.isfinite(rows[-1]).all():
            began = time.process_time()
            state = next(march)
            spent += time.process_time() - began
            rows.append(state.row)
            if progress is not None:
                progress(times[len(rows) - 1] / times[-1])
        return motion_of(
            self.label, scene, times, np.array(rows), settings, timestep=world.longest,
            steps=world.steps, seconds=spent, python_seconds=world.python_seconds(),
        )  # fmt: skip


def longest_step(scene: Scene, times: Array, timestep: float) -> float:
    """The longest step that such a run takes [s]."""
    return float(spans(times, scene.breakpoints, timestep)[1].max())


def motion_of(
    label: Label,
    scene: Scene,
    times: Array,
    rows: Array,
    settings: EngineSettings,
    *,
    timestep: float,
    steps: int,
    seconds: float,
    python_seconds: float,
) -> ContactMotion:
    """The motion of rows (n, 13 + 2h) of State at times (n,), up to its first fault if it ends."""
    rows = rows if np.isfinite(rows[-1]).all() else rows[:-1]
    state = state_of_rows(rows)
    with np.errstate(all="ignore"):
        readings = readings_of(scene, state)
        rate_error = _rate_error(scene, times[: len(rows)], state)
        faults, kept = _faults(scene, times, state, readings, rate_error, settings)
    n, unknown = slice(kept), np.full(len(rows), np.nan)
    hinges = np.full((len(rows), len(scene.drives)), np.nan)
    return ContactMotion(
        scene=scene,
        engine=label,
        times=times[n],
        contact_point=state.centre[n, :2],
        attitude=readings.attitude[n],
        momentum=readings.momentum[n],
        angular_velocity=readings.angular_velocity[n],
        hinge_angles=state.angles[n],
        hinge_rates=state.rates[n],
        loads=Loads(np.stack([unknown] * 3, axis=1)[n], unknown[n], hinges[n]),
        report=ContactReport(
            settings=settings,
            slip=readings.slip[n],
            spin=readings.spin[n],
            depth=scene.ball.radius - state.centre[n, 2],
            friction_used=unknown[n],
            hinge_rate_error=rate_error[n],
            faults=faults,
            timestep=timestep,
            steps=steps,
            seconds=seconds,
            total_seconds=seconds,
            python_seconds=python_seconds,
        ),
    )


def _rate_error(scene: Scene, times: Array, state: State) -> Array:
    """(n,): the largest of all hinges, relative to the largest rate that each has to reach."""
    right = np.stack([drive.rate(times) for drive in scene.drives], axis=1)
    largest = np.abs(right).max(axis=0)
    return np.asarray((np.abs(state.rates - right) / np.where(largest > 0, largest, 1.0)).max(1))


def _faults(
    scene: Scene,
    times: Array,
    state: State,
    readings: Readings,
    rate_error: Array,
    settings: EngineSettings,
) -> tuple[tuple[Fault, ...], int]:
    """What went wrong, by the samples alone, and how many of them stand."""
    count, tolerance = len(state.centre), settings.error_tolerance
    slip = readings.slip
    if scene.rolling == "rubber":
        slip = slip + scene.ball.radius * np.abs(readings.spin)
    elapsed = np.diff(times[:count], prepend=0.0)
    rolled = np.cumsum(np.linalg.norm(np.diff(state.centre[:, :2], axis=0, prepend=0.0), axis=1))
    allowed = tolerance * (rolled + SHORTEST_PATH * scene.ball.radius)
    off = np.linalg.norm(readings.momentum - readings.momentum[0], axis=1)
    size = np.abs(np.concatenate([state.centre, state.velocity, state.turning], axis=1)).max(1)
    kinds: list[tuple[Mask, Fault]] = [
        (size > DIVERGED, Fault(FaultKind.DIVERGED, np.nan, fatal=True)),
        (
            state.centre[:, 2] > (1 + LIFTED) * scene.ball.radius,
            Fault(FaultKind.CONTACT_LOST, np.nan),
        ),
        (rate_error > RATE_ERROR, Fault(FaultKind.RATE_OFF, np.nan, limit=RATE_ERROR)),
        (np.cumsum(slip * elapsed) > allowed, Fault(FaultKind.SLIPPED, np.nan, limit=tolerance)),
        (
            scene.keeps_momentum & (off > tolerance * scene.momentum_scale),
            Fault(FaultKind.MOMENTUM_OFF, np.nan, limit=tolerance),
        ),
    ]
    found = [(int(np.argmax(mask)), fault) for mask, fault in kinds if mask.any()]
    if count < len(times):
        found.append((count, Fault(FaultKind.DIVERGED, np.nan, fatal=True)))
    found.sort(key=lambda each: each[0])
    ends = [row for row, fault in found if fault.fatal or settings.stop_at_fault]
    kept = min([*ends, count])
    dated = [
        Fault(f.kind, float(times[min(row, len(times) - 1)]), f.subject, f.limit, f.fatal)
        for row, f in found
        if row <= kept
    ]
    return tuple(dated), max(kept, 1)


def version_of(distribution: str) -> str:
    """Of a package that may be there; nothing is imported."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"
