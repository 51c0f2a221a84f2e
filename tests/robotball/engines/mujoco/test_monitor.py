"""A run that goes wrong is reported with its time and cause, and never passes for a result."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.monitor import Monitor
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.stepping import by_steps, controlled, read_row
from robotball.motors import Servo
from validation import compare

pytestmark = pytest.mark.core

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
KEEP_GOING = replace(FAST, stop_at_fault=False)


def faults_of(settings: rb.Settings, scene: rb.Scene = FIG12) -> dict[str, float]:
    """The causes and times of a run's faults."""
    faults = rb.simulate(scene, settings=settings).report.faults
    return {fault.text: fault.time for fault in faults}


@pytest.mark.parametrize("settings", rb.PRESETS.values(), ids=rb.PRESETS)
def test_only_the_naive_preset_has_faults(settings: rb.Settings) -> None:
    """A newcomer's model slips, bounces and loses its rates; the recipe does none of it."""
    faults = faults_of(settings)
    if settings.name == "naive":
        assert set(faults) == {
            "hinge rate off by over 0.001",
            "friction cone saturated",
            "contact lost",
            "slipped over 0.01 of the path",
            "M off by over 0.01",
        }
    else:
        assert faults == {}


def test_a_diverging_run_ends_at_the_step_that_diverged() -> None:
    """Explicit steps of half a second blow up: no sample after that, no measure, one cause."""
    long = replace(KEEP_GOING, timestep=0.5, integrator="Euler")
    agreement = compare(FIG12, long, np.arange(21) / 2)
    diverged = [fault for fault in agreement.faults if fault.fatal]
    assert [fault.text for fault in diverged] == ["the state diverged"]
    assert agreement.motion.times[-1] == diverged[0].time - 0.5
    assert np.isfinite(agreement.motion.contact_point).all()
    assert (agreement.path_error, agreement.gamma_error, agreement.momentum_error) == (None,) * 3
    assert not agreement.agrees


def test_too_little_friction_is_reported_from_the_moment_it_slips() -> None:
    """The demand peaks at 1.32 of the weight; with a limit of 1, the run fails when that is asked.

    MuJoCo's sliding contact throws the ball up for a step before it saturates.
    """
    demand = rb.simulate(FIG12, settings=FAST).loads.sliding_friction
    faults = faults_of(replace(KEEP_GOING, sliding_friction=1.0))
    assert next(iter(faults)) == "contact lost"
    assert "friction cone saturated" in faults
    assert faults["contact lost"] == pytest.approx(FIG12.times[np.argmax(demand > 1.0)])
    assert demand.max() == pytest.approx(1.3214, abs=1e-3)


def test_a_weak_servo_is_reported() -> None:
    """A velocity servo too weak for its load misses its rate, and the run says so."""
    weak = replace(FAST, timestep=2e-3, drive=Servo(gain=1.0))
    assert "hinge rate off by over 0.001" in faults_of(weak)


def test_a_weak_motor_of_the_scenes_own_is_told_and_goes_on() -> None:
    """At its torque limit it makes another motion, which is rolled to the end."""
    scene = rb.load_scene("servo_motors")
    motors = tuple(Servo(gain=100.0, torque_limit=0.05) for _ in scene.motors)
    motion = rb.simulate(replace(scene, motors=motors), settings="balanced")
    notes = [note.text for note in motion.report.notes]
    assert notes == [f"{body}'s motor at its torque limit" for body in ("frame", "rotor1")]
    assert motion.report.faults == ()
    assert motion.times[-1] == scene.duration


def test_a_ball_thrown_up_has_lost_contact() -> None:
    """Readings of a ball in the air are reported, at the first time it is there."""
    model = build(FIG12, FAST)
    data = model.start_data()
    rows = []
    for step in range(4):
        if step == 2:
            data.qpos[2] += 0.5
        mujoco.mj_step(model.compiled, data)
        rows.append(np.concatenate([data.sensordata, data.warning.number]))
    found = Monitor(model).look(Readings(model, np.array(rows)))
    # Its M is about the point below it, so that is another one up there.
    causes = ["contact lost", "M off by over 0.0005"]
    assert [(each.fault.text, each.fault.time) for each in found] == [(c, 0.04) for c in causes]


@pytest.mark.parametrize("name", ["fig12", "classical_regular"])
@pytest.mark.parametrize(
    ("share", "causes"), [(0.9, []), (1.1, ["slipped over 0.0005 of the path"])]
)
def test_a_slip_is_a_fault_from_its_limit_on(name: str, share: float, causes: list[str]) -> None:
    """A share of the limit's slip is written into every step of a sound run's readings."""
    model = build(rb.load_scene(name), FAST)
    with controlled(model) as control:
        (portion,) = by_steps(control, model.start_data(), np.linspace(0.0, 1.0, 11))
    rows = portion.rows.copy()
    readings = Readings(model, rows)
    steps = np.diff(readings.centre[:, :2], axis=0, prepend=readings.centre[:1, :2])
    contact = np.arange(rows.shape[1])[model.sensor_columns["contact"]]
    rows[:, contact[14:16]] = share * FAST.error_tolerance * steps / model.compiled.opt.timestep
    rows[:, contact[16]] = 0.0
    found = Monitor(model).look(Readings(model, rows))
    assert [each.fault.text for each in found] == causes


def test_a_reset_is_seen_by_its_clock() -> None:
    """MuJoCo resets a bad state to time 0 and goes on; time going back gives it away."""
    model = build(FIG12, FAST)
    data = model.start_data()
    rows = []
    for step in range(4):
        if step == 2:
            mujoco.mj_resetDataKeyframe(model.compiled, data, 0)
        mujoco.mj_step(model.compiled, data)
        rows.append(np.concatenate([data.sensordata, data.warning.number]))
    ((_, fault),) = Monitor(model).look(Readings(model, np.array(rows)))
    assert fault.fatal
    assert fault.text == "time went back: the engine reset the state"


def test_mujocos_own_warnings_are_faults() -> None:
    """A control that MuJoCo calls bad is a fault with the counter's name."""
    model = build(FIG12, replace(FAST, drive=Servo(gain=1.0)))
    data = model.start_data()
    data.ctrl[0] = np.nan
    mujoco.mj_step(model.compiled, data)
    row = np.concatenate([data.sensordata, data.warning.number])
    found = Monitor(model).look(Readings(model, row[None]))
    assert "the engine warned of BADCTRL" in [each.fault.text for each in found]


def test_a_model_never_resets_itself() -> None:
    """The autoreset flag is off whatever the settings, so that a NaN stays one."""
    for settings in rb.PRESETS.values():
        flags = build(FIG12, settings).compiled.opt.disableflags
        assert flags & mujoco.mjtDisableBit.mjDSBL_AUTORESET


def test_the_cone_used_is_one_on_its_surface() -> None:
    """Pyramidal and elliptic: a sliding contact's force lies on the cone of its own kind."""
    for cone in ("elliptic", "pyramidal"):
        slippery = replace(KEEP_GOING, timestep=2e-3, cone=cone, sliding_friction=0.05)
        diagnostics = rb.simulate(FIG12, settings=slippery).report
        assert diagnostics is not None
        # Measured 1 + 2.2e-16: rounding.
        assert diagnostics.friction_used.max() == pytest.approx(1.0, abs=2e-15)


def test_every_step_is_read_with_the_warnings_so_far() -> None:
    """The rows of a run that diverges are those of a plain loop that copies all after each step.

    MuJoCo warns first in the tenth step; the last row is of the end, from which no step was taken.
    """
    model = build(FIG12, replace(rb.PRESETS["naive"], timestep=0.02))
    times = np.linspace(0.0, 0.3, 16)
    with controlled(model) as control:
        (portion,) = by_steps(control, model.start_data(), times)
    data, rows = model.start_data(), []
    for length in np.minimum(np.diff(times), 0.02):
        model.compiled.opt.timestep = length
        mujoco.mj_step(model.compiled, data)
        rows.append(read_row(data))
    mujoco.mj_forward(model.compiled, data)
    rows.append(read_row(data))
    np.testing.assert_array_equal(portion.rows, rows)
    warned = Readings(model, portion.rows).warnings.any(axis=1)
    assert warned.tolist() == [False] * 9 + [True] * 7
    assert portion.steps == 15
    assert list(portion.sampled) == list(range(16))
