"""Control of a run: the values set at every evaluation of the forces, and how steps are taken.

Controls are computed at every evaluation, because controls that are held over a step would lower
RK4's order by two. MuJoCo's callbacks only write controls and gravity: MuJoCo 4.0 never returns if
a function that is called within a callback raises a warning (docs/findings).
"""

from bisect import bisect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotball.engines.mujoco.model import Model, controls_at
from robotball.motion import Fault
from robotball.rotations import Array

if TYPE_CHECKING:
    from robotball.robot.loop import Loop

FREE_QPOS, FREE_QVEL = 7, 6  # coordinates and velocities of the free joint; hinges follow
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_NO_STAGE = int(mujoco.mjtStage.mjSTAGE_NONE)
# s. Before a breakpoint a drive is evaluated this much earlier, because the next piece of the drive
# begins at the breakpoint.
_INSIDE = 1e-9
# A run may take this many parts for each planned step, and this many more in total. A robot that
# slowly leans over leaves its standstill in up to 11 578 parts of one step, and in 53 000 parts of
# 10 500 steps.
_PARTS, _MOST_PARTS = 60, 10_000

Step = Callable[[mujoco.MjData, float], None]
"""Takes one step of a length [s]. Leaves the sensors of the state before the step."""
Steps = Callable[[mujoco.MjData, float], Iterator[float]]
"""Takes one step of a length [s], in parts if necessary. Yields the length of each part."""
_Forward = Callable[[mujoco.MjData, bool], None]
"""Evaluates the forces at the state of MjData, with the sensors if the second argument is true."""


class Interpolating(Protocol):
    """Steps that give the states inside the last step; see `order8`."""

    pending: Array

    def within(self, data: mujoco.MjData, times: Array) -> Array:
        """Return the states (m, n) at times (m,) [s] inside the last step."""

    def rows(self, data: mujoco.MjData) -> tuple[bool, list[Array]]:
        """Return whether the last step began on a sample time, and the rows inside the step."""


def read_row(data: mujoco.MjData) -> Array:
    """Return the sensor values of a state, which must be current, and the warning counters."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """Return the numbers (n,) that a step depends on."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


def mujoco_step(data: mujoco.MjData, length: float) -> None:
    """Take one step of a length [s] with MuJoCo's integrator."""
    data.model.opt.timestep = length
    mujoco.mj_step(data.model, data)


def _mujoco_forward(data: mujoco.MjData, sensors: bool) -> None:
    """Evaluate MuJoCo's forces."""
    mujoco.mj_forwardSkip(data.model, data, _NO_STAGE, not sensors)


def _in_contact(data: mujoco.MjData, x: float, y: float, spin: float) -> Array:
    """Return a vector along the world's X and Y, and a spin, in the axes of the contact (3,)."""
    frame = data.contact[0].frame
    return np.array([frame[3] * x + frame[4] * y, frame[6] * x + frame[7] * y, spin])


def put(data: mujoco.MjData, t: float, state: Array) -> None:
    """Set time [s] and state (qpos, qvel)."""
    data.time = t
    data.qpos, data.qvel = state[: len(data.qpos)], state[len(data.qpos) :]


@dataclass(frozen=True)
class Stretch:
    """Consecutive spans of time that are stepped before the monitor reads them.

    Attributes
    ----------
    ends : (m, 2), s
        The begin and end of each span.
    lengths : (m,), s
        The length of the steps in each span.
    counts : (m,)
        The number of steps in each span.
    samples : (k,)
        The steps, counted over the stretch, that start at a sample time.
    """

    ends: Array
    lengths: Array
    counts: NDArray[np.int64]
    samples: NDArray[np.int64]

    def __iter__(self) -> Iterator[tuple[list[float], float, int]]:
        ends, lengths, counts = self.ends.tolist(), self.lengths.tolist(), self.counts.tolist()
        return zip(ends, lengths, counts, strict=True)


@dataclass(frozen=True)
class Portion:
    """A part of a run that the monitor reads at once.

    Attributes
    ----------
    rows : (m, n)
        Rows of `read_row`, in the order of time.
    sampled : (k,)
        The indices of the rows at the sample times.
    steps : int
        The number of steps taken.
    longest : float, s
        The longest of these steps.
    seconds : float, s
        The processor time of the steps in this thread, which does not depend on other work.
    failure : Fault or None
        Why the run cannot continue.
    """

    rows: Array
    sampled: NDArray[np.int64]
    steps: int
    longest: float
    seconds: float
    failure: Fault | None = None


class TooManyPartsError(Exception):
    """Raised if the parts of a run's steps become so short that the run would not end."""


class Control:
    """Control of a run.

    Attributes
    ----------
    model : Model
        The model. Its scene has the commands of the controller so far.
    span : (float, float), s
        The smooth span of time that the run is in.
    loop : Loop or None
        The loop of the scene's controller.
    forward : callable
        Evaluates the forces.
    step : callable
        Takes one step.
    friction : callable or None
        Returns the torques (h,) of dry friction at the rates (h,) of the hinges.
    order_8 : Interpolating or None
        Takes the steps of order 8.
    steps : callable or None
        Takes one step in parts. None if steps have no parts.
    timestep : float, s
        The longest step.
    planned, taken : int
        The number of timesteps so far, and the number of steps taken for them, including trial
        steps.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.loop: Loop | None = None
        if model.scene.controller is not None:
            from robotball.engines.mujoco.readings import sensor_reader
            from robotball.robot import loop  # few scenes need it

            self.loop = loop.Loop(model.scene, model.scene.controller)
            self.model = model.of(self.loop.scene)
            self.sensed = sensor_reader(self.model)
        self.span: Sequence[float] = (0.0, 0.0)
        self.breakpoints = model.scene.breakpoints
        # A pyramidal cone has no rows for friction only.
        elliptic = model.compiled.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
        self.turns = model.scene.plane_turns and elliptic
        self.forward: _Forward = _mujoco_forward
        self.step: Step = mujoco_step
        self.friction: Callable[[Array], Array] | None = None
        self.planned = self.taken = 0
        self.timestep = model.settings.timestep or model.compiled.opt.timestep
        self.order_8: Interpolating | None = None
        self.steps: Steps | None = None

    @property
    def steady(self) -> bool:
        """True if the controls that are set now hold until the next span."""
        holds = self.loop.holds if self.loop else self.model.scene.steady
        return holds and not self.turns

    @property
    def is_plain(self) -> bool:
        """True if a run consists only of MuJoCo's steps."""
        return self.steady and self.steps is None and self.loop is None

    def install(self) -> None:
        """Make MuJoCo call `set` at every evaluation of the forces, if there is anything to set."""
        # A call of Python takes 8 µs, and steady controls are in MjData already.
        mujoco.set_mjcb_control(None if self.steady and self.friction is None else self.set)

    def begin(self, data: mujoco.MjData, span: Sequence[float]) -> None:
        """Begin a smooth span of time [s] from the state of `data`, with the controls of its start.

        If a span is repeated, the commands are the same.
        """
        self.span = span
        if self.loop is not None:
            self.loop.reach(span[0], lambda: self.sensed(data))
            data.ctrl[:] = controls_at(self.model.scene, self.model.hinges, span[0])
            self.install()

    def whole(self, data: mujoco.MjData, length: float) -> Iterator[float]:
        """Take one step in one part."""
        self.take(data, length)
        yield length

    def take(self, data: mujoco.MjData, length: float) -> None:
        """Take one step of a length [s]. Raises TooManyPartsError after too many parts."""
        self.taken += 1
        if self.taken > _MOST_PARTS + _PARTS * self.planned:
            raise TooManyPartsError(
                f"{self.planned} steps have {self.taken} parts, near a standstill or at torque "
                "limits: choose another timestep, a lower gain, or no friction.rolling"
            )
        self.step(data, length)

    def inside(self, t: float) -> float:
        """Return the time [s] nearest to t on the span's side of the breakpoints around it."""
        begin, _ = self.span
        following = bisect(self.breakpoints, begin + _INSIDE)
        if following < len(self.breakpoints):
            t = min(t, self.breakpoints[following] - _INSIDE)
        return max(begin, t)

    def set(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set the controls of the hinges at the time of `data`, and their dry friction."""
        data.ctrl[:] = controls_at(self.model.scene, self.model.hinges, self.inside(data.time))
        if self.friction is not None:
            data.qfrc_applied[FREE_QVEL:] = self.friction(data.qvel[FREE_QVEL:])
        if self.turns:
            self._follow(data)

    def _follow(self, data: mujoco.MjData) -> None:
        """Add the acceleration of a turning plane's surface to the rows of friction.

        MuJoCo leaves this acceleration out of its contact rows, like the term of a frame root: a
        ball at the velocity v would slip by Ωv/b. The rows are set and not incremented, because
        trials at one state call this method more than once.
        """
        if not data.ncon or (first := data.contact[0].efc_address) < 0:
            return
        scene, t = self.model.scene, self.inside(data.time)
        surface = scene.plane_acceleration(t, *data.qpos[:2].tolist(), *data.qvel[:2].tolist())
        wanted = _in_contact(data, *surface)
        rows = slice(first + 1, first + min(data.contact[0].dim, 1 + len(wanted)))
        slip, damping = data.efc_vel[rows], data.efc_KBIP[rows, 1]
        data.efc_aref[rows] = wanted[: len(slip)] - damping * slip

    def fall(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set the moving plane's gravity and surface velocity at the time of `data`."""
        scene, t = self.model.scene, self.inside(data.time)
        model.opt.gravity = scene.gravity_at(t)
        if scene.plane_turns:
            model.flg_surfacevel = True  # the flag is false if the plane starts from rest
            if data.ncon:  # MuJoCo counts the velocity of the second geom, the shell, as positive
                surface = scene.plane_velocity(t, data.qpos[:2]).tolist()
                data.contact[0].surfacevel = -_in_contact(data, *surface)
