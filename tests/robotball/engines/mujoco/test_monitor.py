"""A failing run is reported with its time and cause, and is never taken for a result."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball import FaultKind
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.control import read_row
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.readings import own_faults, readings_of
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.stepping import by_steps, controlled
from robotball.engines.observe import Recording, spans
from robotball.robot.motors import Servo
from robotball.rotations import Array
from tests.motions import pair_of

pytestmark = pytest.mark.core

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
KEEP_GOING = replace(FAST, stop_at_fault=False)

# (scene, settings, reported faults)
FAULTS: dict[str, tuple[rb.Scene, rb.Settings, set[tuple[FaultKind, float]]]] = {
    # Default settings slip, bounce and miss the prescribed rates.
    "naive": (FIG12, rb.preset("naive"), {
        (FaultKind.RATE_OFF, 0.001), (FaultKind.CONE_SATURATED, 0.0),
        (FaultKind.CONTACT_LOST, 0.0), (FaultKind.SLIPPED, 0.01), (FaultKind.MOMENTUM_OFF, 0.01),
    }),
    # M is conserved to 1e-8 while the ball slips off its path.
    "the frame as root": (
        FIG12, replace(FAST, root="frame"), {(FaultKind.SLIPPED, 0.0005)}
    ),
    "no torsional row": (FIG12, replace(FAST, condim=3), {(FaultKind.SLIPPED, 0.0005)}),
    # MuJoCo gives no warning, and M is wrong at once.
    "Euler at fast rotors": (
        FIG12.with_hinges(command={"rotor1": 30 * 148.0}),
        replace(FAST, integrator="Euler", timestep=1e-3, sliding_friction=1e4,
                torsional_friction=1e4),
        {(FaultKind.MOMENTUM_OFF, 0.0005)},
    ),
    "a weak servo": (
        FIG12, replace(FAST, timestep=2e-3, drive=Servo(gain=1.0)),
        {(FaultKind.RATE_OFF, 0.001)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_failing_run_reports_its_faults(name: str) -> None:
    scene, settings, causes = FAULTS[name]
    faults = rb.simulate(scene, settings=settings).report.faults
    assert {(fault.kind, fault.limit) for fault in faults} == causes


@pytest.mark.parametrize(
    ("preset", "frequency", "off"),
    [
        ("fast", 50.0, True),
        ("fast", 100.0, True),
        ("fast", 150.0, True),
        ("fast", 200.0, True),
        ("balanced", 200.0, True),
        ("balanced", 400.0, True),
        ("balanced", 199.0, True),
        ("balanced", 7.0, False),
        ("fast", 7.0, False),
    ],
)
def test_a_drive_that_steps_alias_to_a_constant_is_a_fault(
    preset: str, frequency: float, off: bool
) -> None:
    """Detected during the run: hinge angle and path are 2.5 % too large.

    The rates at the ends of steps reveal it only for 199 Hz.
    """
    sine = rb.Sine(mean=2.0, amplitude=0.05, frequency=frequency, phase=np.pi / 2)
    model = build(FIG12.with_hinges(command={"frame": sine}), rb.preset(preset))
    faults = run(model, np.linspace(0.0, 0.4, 21)).report.faults
    assert [fault.kind for fault in faults] == [FaultKind.RATE_OFF] * off


def test_a_diverging_run_ends_at_the_step_that_diverged() -> None:
    """It has no samples after that, no finite error, and one fatal fault.

    A fault in the initial state leaves no samples.
    """
    slippery = replace(FAST, sliding_friction=0.2)
    pair = pair_of(FIG12, slippery, np.linspace(0.0, 1.0, 11))
    assert (len(pair.motion.times), pair.path_error) == (0, np.inf)
    assert {fault.time for fault in pair.report.faults} == {0.0}
    long = replace(KEEP_GOING, timestep=0.5, integrator="Euler")
    pair = pair_of(FIG12, long, np.arange(21) / 2)
    diverged = [fault for fault in pair.report.faults if fault.fatal]
    assert [fault.kind for fault in diverged] == [FaultKind.DIVERGED]
    assert pair.motion.times[-1] == diverged[0].time - 0.5
    assert np.isfinite(pair.motion.contact_point).all()
    assert (pair.path_error, pair.gamma_error, pair.momentum_error) == (np.inf,) * 3
    assert not pair.agrees


def test_too_little_friction_is_reported_when_the_demand_exceeds_it() -> None:
    """The demand peaks at 1.32 of the weight, and the friction coefficient is 1.

    The contact is lost for a step before its friction cone saturates. A run that stops at faults
    lists only the first.
    """
    demand = rb.simulate(FIG12, settings=FAST).loads.sliding_friction
    slippery, times = replace(FAST, sliding_friction=1.0), rb.sample_times(1.0)
    on = rb.simulate(FIG12, times, settings=replace(slippery, stop_at_fault=False))
    first = on.report.faults[0]
    assert first.kind is FaultKind.CONTACT_LOST
    assert FaultKind.CONE_SATURATED in [fault.kind for fault in on.report.faults]
    assert first.time == pytest.approx(FIG12.times[np.argmax(demand > 1.0)])
    assert demand.max() == pytest.approx(1.3214, abs=1e-3)
    assert on.times[-1] == 1.0
    motion = rb.simulate(FIG12, times, settings=slippery)
    (fault,) = motion.report.faults
    assert (fault.kind, fault.fatal, fault.time) == (FaultKind.CONTACT_LOST, True, first.time)
    assert motion.times[-1] < fault.time <= motion.times[-1] + 0.02 * (1 + 1e-9)


def rows_of(model: Model, duration: float) -> Array:
    """Return the rows of a sound run in 20 ms steps."""
    with controlled(model) as control:
        portions = by_steps(control, model.start_data(), np.array([0.0, duration]))
        return np.concatenate([portion.rows for portion in portions])


def faults_of(model: Model, *parts: Array) -> list[rb.Fault]:
    """Return the faults of a run whose rows are recorded in parts."""
    end = readings_of(model, parts[-1]).time[-1]
    recording = Recording(LABEL, model.scene, model.settings, np.array([0.0, end]))
    for rows in parts:
        readings = readings_of(model, rows)
        recording.add(readings, np.array([], int), own_faults(model, rows, readings))
    return list(recording.faults.values())


def causes_and_times(model: Model, rows: Array) -> list[tuple[FaultKind, float]]:
    return [(fault.kind, fault.time) for fault in faults_of(model, rows)]


def test_a_ball_in_the_air_has_lost_contact() -> None:
    """From the first step in the air; M about the point below the ball is off as well."""
    model = build(FIG12, FAST)
    data, rows = model.start_data(), []
    for step in range(4):
        if step == 2:
            data.qpos[2] += 0.5
        mujoco.mj_step(model.compiled, data)
        rows.append(read_row(data))
    causes = (FaultKind.CONTACT_LOST, FaultKind.MOMENTUM_OFF)
    assert causes_and_times(model, np.array(rows)) == [(cause, 0.04) for cause in causes]


@pytest.mark.parametrize("name", ["fig12", "classical_regular"])
def test_a_slip_beyond_its_limit_is_a_fault(name: str) -> None:
    """A fraction of the largest allowed slip is written into the readings of a sound run.

    Recording the rows in two parts gives the same time.
    """
    model = build(rb.load_scene(name), FAST)
    rows = rows_of(model, 1.0)
    steps = np.diff(readings_of(model, rows).centre[:, :2], axis=0, prepend=np.zeros((1, 2)))
    contact = np.arange(rows.shape[1])[model.sensor_columns["contact"]]
    rows[:, contact[16]] = 0.0
    results = []
    for later in (0.9, 1.1):
        share = np.where(np.arange(len(rows)) < 10, 0.9, later)[:, None]
        slip = share * FAST.error_tolerance * steps / model.compiled.opt.timestep
        rows[:, contact[14:16]] = slip
        results.append(causes_and_times(model, rows))
    ((cause, time),) = results[1]
    assert (results[0], cause) == ([], FaultKind.SLIPPED)
    assert time > 0.3
    assert [fault.time for fault in faults_of(model, rows[:15], rows[15:])] == [time]


@pytest.mark.parametrize(("share", "faults"), [(0.9, []), (1.1, [FaultKind.SLIPPED])])
def test_a_slip_at_the_start_is_relative_to_the_radius(
    share: float, faults: list[FaultKind]
) -> None:
    """Relative to the path, any start from rest would fail, since regularised friction creeps."""
    model = build(rb.load_scene("classical_regular"), FAST)
    rows = rows_of(model, 0.1)
    contact = np.arange(rows.shape[1])[model.sensor_columns["contact"]]
    rows[:, contact[14:17]] = 0.0
    length = share * FAST.error_tolerance * model.scene.ball.radius
    rows[1, contact[14]] = length / model.compiled.opt.timestep
    assert [cause for cause, _ in causes_and_times(model, rows)] == faults


def test_a_reset_and_warnings_by_mujoco_are_faults() -> None:
    """A reset shows as decreasing time; an invalid control increments a warning counter."""
    model = build(FIG12, FAST)
    rows = rows_of(model, 0.08)
    (fault,) = faults_of(model, np.array([*rows[:3], *rows[:3]]))
    assert fault.fatal
    assert fault.kind is FaultKind.RESET
    model = build(FIG12, replace(FAST, drive=Servo(gain=1.0)))
    data = model.start_data()
    data.ctrl[0] = np.nan
    mujoco.mj_step(model.compiled, data)
    (fault,) = (
        f for f in faults_of(model, read_row(data)[None]) if f.kind is FaultKind.ENGINE_WARNED
    )
    assert fault.subject == "BADCTRL"


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_a_sliding_contact_uses_all_of_its_friction_cone(cone: str) -> None:
    """Its force lies on the surface of the elliptic or pyramidal cone."""
    slippery = replace(KEEP_GOING, timestep=2e-3, cone=cone, sliding_friction=0.05)
    used = rb.simulate(FIG12, rb.sample_times(0.2), settings=slippery).report.friction_used
    # Measured 1 + 2.2e-16: rounding.
    assert used.max() == pytest.approx(1.0, abs=2e-15)


def test_every_step_is_recorded_with_its_warning_counts() -> None:
    """The rows of a diverging run equal those of a plain loop that copies them after each step.

    The first warning is in the tenth step; the last row is the final state.
    """
    servo = rb.Servo(gain=10.0)
    model = build(FIG12, replace(rb.PRESETS["naive"], timestep=0.02, drive=servo))
    times = np.linspace(0.0, 0.3, 16)
    with controlled(model) as control:
        portion, end = by_steps(control, model.start_data(), times)
    data, rows = model.start_data(), []
    for length in spans(times, (), 0.02)[1]:
        model.compiled.opt.timestep = length
        mujoco.mj_step(model.compiled, data)
        rows.append(read_row(data))
    mujoco.mj_forward(model.compiled, data)
    rows.append(read_row(data))
    np.testing.assert_array_equal(np.concatenate([portion.rows, end.rows]), rows)
    warned = np.array(rows)[:, model.compiled.nsensordata :].any(axis=1)
    assert warned.tolist() == [False] * 9 + [True] * 7
    assert (portion.steps, end.steps) == (15, 0)
    assert [*portion.sampled, *end.sampled] == [*range(15), 0]
