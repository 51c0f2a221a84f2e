"""Every engine's run is judged with the same criteria."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.readings import readings_of
from robotball.engines.mujoco.stepping import by_steps, controlled
from robotball.engines.observe import Recording
from robotball.engines.states import State, motions_of
from robotball.motion import ContactMotion, EngineSettings, momentum_error
from robotball.rotations import Array, conjugate, multiply, rotation_matrix

pytestmark = pytest.mark.core

TIMES = np.arange(601) / 10  # a minute
SETTINGS = EngineSettings(name="loose", error_tolerance=1e-3, stop_at_fault=False)
SCENE = rb.load_scene("fig12").until(60.0)
THEORY = rb.integrate(SCENE, TIMES)


def by_an_adapter(drift: float) -> ContactMotion:
    """Return the equations' motion as an adapter records it, with ω growing by `drift`."""
    shell, a = SCENE.ball.shell, SCENE.ball.radius
    half = THEORY.hinge_angles[:, :1] / 2
    back = conjugate(np.concatenate([np.cos(half), np.sin(half) * shell.axis], axis=1))
    shell_omega = THEORY.angular_velocity - THEORY.hinge_rates[:, :1] * shell.axis
    omega = np.einsum("nij,nj->ni", rotation_matrix(THEORY.attitude), shell_omega)
    omega *= _growing(drift, TIMES)
    centre = np.column_stack([THEORY.contact_point, np.full(len(TIMES), a)])
    state = State(
        centre,
        np.cross(omega, [0.0, 0.0, a]),
        multiply(THEORY.attitude, back),
        omega,
        THEORY.hinge_angles,
        THEORY.hinge_rates,
    )
    cost: Any = {"timestep": 0.1, "steps": 600, "seconds": 1.0}
    rows = state.row[None]
    (motion,) = motions_of([SCENE], TIMES, rows, THEORY.engine, SETTINGS, **cost)
    return motion


def by_mujoco(drift: float) -> ContactMotion:
    """Return a run with MuJoCo whose momentum sensors grow by `drift`."""
    model = build(SCENE, rb.preset("fast"))
    recording = Recording(LABEL, SCENE, SETTINGS, TIMES)
    with controlled(model) as control:
        for portion in by_steps(control, model.start_data(), TIMES):
            rows = portion.rows
            for sensor in ("angular_momentum", "velocity"):
                rows[:, model.sensor_columns[sensor]] *= _growing(drift, rows[:, 0])
            recording.add(readings_of(model, rows), portion.sampled)
    return recording.motion(timestep=0.02, steps=3000, seconds=1.0)


def _growing(drift: float, times: Array) -> Array:
    return 1 + drift * times[:, None] / TIMES[-1]


@pytest.mark.parametrize("engine", [by_an_adapter, by_mujoco])
def test_a_slow_drift_of_momentum_is_judged_alike_for_all_engines(
    engine: Callable[[float], ContactMotion],
) -> None:
    """The tolerance of 1e-3 is for ten seconds: in a minute 0.59 % is accepted, 0.61 % is not.

    The error of M is linear in the drift.
    """
    size = momentum_error(engine(1e-3), THEORY) / 1e-3
    within, beyond = (engine(error / size) for error in (5.9e-3, 6.1e-3))
    assert within.report.faults == ()
    (fault,) = beyond.report.faults
    assert (fault.kind, fault.limit) == (rb.FaultKind.MOMENTUM_OFF, 1e-3)
    assert fault.time == pytest.approx(10.0, abs=50)
