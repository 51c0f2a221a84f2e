"""Every run that fails is warned of or stopped where it does, and no alarm is false."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.monitor import Monitor
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.settings import ADAPTIVE, OWN, Prescribed
from robotball.motors import Servo
from validation import compare
from validation.studies.random_runs import extreme, judged, ordinary

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
SEED = 7


@pytest.mark.slow
@pytest.mark.parametrize("number", range(40))
def test_no_extreme_run_fails_unreported(number: int) -> None:
    """Far out along one to three axes: a path over 10 % off is warned of, or stopped, or both."""
    assert not judged(extreme(SEED, number)).missed


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_no_ordinary_run_is_called_wrong(number: int) -> None:
    """A recipe preset on a varied ball of the catalog: no warning, no fault, within tolerance."""
    each = judged(ordinary(SEED, number))
    assert each.within
    assert not each.reported


def test_a_run_stops_at_its_first_fault() -> None:
    """Nothing after it is given, and every fault that is listed began at that very step."""
    slippery = replace(FAST, sliding_friction=1.0)
    motion = rb.simulate(FIG12, settings=slippery)
    (fault,) = motion.report.faults
    assert (fault.text, fault.fatal) == ("contact lost", True)
    assert motion.times[-1] < fault.time <= motion.times[-1] + 0.02 * (1 + 1e-9)
    on = rb.simulate(FIG12, settings=replace(slippery, stop_at_fault=False))
    assert on.times[-1] == 10.0
    assert on.report.faults[0].time == fault.time
    assert len(on.report.faults) > 1


@pytest.mark.slow
def test_the_samples_do_not_change_what_is_found() -> None:
    """Every step is monitored: with two samples the fault is at the same step as with five hundred.

    A look takes 4096 steps, and what slipped and rolled before counts on in the next.
    """
    slow = replace(FAST, timestep=1e-3, sliding_friction=1.32)
    times = []
    for samples in (np.array([0.0, 10.0]), FIG12.times):
        motion = rb.simulate(FIG12, samples, slow)
        times.append(motion.report.faults[0].time)
    assert times[0] == pytest.approx(times[1], abs=1e-9)


def test_slip_counts_from_look_to_look() -> None:
    """A monitor that sees the rows in two parts finds what one look at all of them finds."""
    model = build(FIG12, replace(FAST, root="frame", stop_at_fault=False))
    rows = np.concatenate(_rows(model, 60))
    whole = Monitor(model).look(Readings(model, rows))
    monitor = Monitor(model)
    parts = [monitor.look(Readings(model, rows[:7])), monitor.look(Readings(model, rows[7:]))]
    assert whole[0].fault == [*parts[0], *parts[1]][0].fault


def _rows(model: Any, steps: int) -> list[Any]:
    from robotball.engines.mujoco.stepping import by_steps, controlled

    with controlled(model) as control:
        return [
            p.rows for p in by_steps(control, model.start_data(), np.array([0.0, steps * 0.02]))
        ]


def test_the_frame_as_root_is_caught_by_its_slip_alone() -> None:
    """M keeps to 1e-8 while the ball slips off its path; the monitor goes by the slip."""
    motion = rb.simulate(FIG12, settings=replace(FAST, root="frame"))
    assert [fault.text for fault in motion.report.faults] == ["slipped over 0.0005 of the path"]


def test_silent_growth_of_m_is_caught() -> None:
    """Euler at rotors of thirty times the rate: no warning of MuJoCo's, and M is off at once."""
    fast = replace(FIG12, rotor_rates=(30 * 148.0,))
    settings = replace(
        FAST, integrator="Euler", timestep=1e-3, sliding_friction=1e4, torsional_friction=1e4
    )
    diagnostics = rb.simulate(fast, np.linspace(0, 1, 11), settings).report
    assert diagnostics is not None
    assert "M off by over 0.0005" in [fault.text for fault in diagnostics.faults]


@pytest.mark.slow
def test_a_start_from_rest_is_measured_by_k() -> None:
    """M(0) = 0 is no scale; the frame and the rotors that turn the ball give one."""
    for name in ("fig05b", "fig06", "spin_up_from_rest"):
        diagnostics = rb.simulate(rb.load_scene(name), settings="adaptive").report
        assert diagnostics is not None
        assert diagnostics.faults == ()


def test_a_run_of_too_many_steps_is_refused_with_the_numbers() -> None:
    """Before anything is built; an adaptive run is stopped when it has taken them."""
    words = (
        r"fig12 over 1e\+06 s takes 50000000 steps of 0\.02 s, more than max_steps = 10000000: "
        r"shorten the run"
    )
    with pytest.raises(rb.InputError, match=words):
        rb.simulate(FIG12, np.array([0.0, 1e6]), "fast")
    with pytest.raises(rb.InputError, match="more than max_steps"):
        rb.simulate(FIG12, np.array([0.0, 1e45]), "fast")
    few = replace(rb.preset("adaptive"), max_steps=100)
    motion = rb.simulate(FIG12, settings=few)
    assert motion.report.steps == 100
    (fault,) = motion.report.faults
    assert fault.text == "max_steps = 100 are taken"
    assert motion.times[-1] <= fault.time < 10.0


BAD = {
    "integrator must be one of Euler, implicit, .*, not 'rk5'": {"integrator": "rk5"},
    r"timestep must be positive and finite, from 1e-50 to 1e\+50, not 0": {"timestep": 0.0},
    r"timestep must be positive and finite, .*, not nan": {"timestep": np.nan},
    r"timestep must be positive and finite, .*, not '1'": {"timestep": "1"},
    r"solref must be two finite numbers": {"solref": (0.02, -1.0)},
    r"solreffriction must be two finite numbers": {"solreffriction": (1.0,)},
    r"sliding_friction must be finite and not negative": {"sliding_friction": -1.0},
    r"condim must be one of 3, 4, 6, not 5": {"condim": 5},
    r"DOP853 needs an rtol": {"integrator": "DOP853"},
    r"rtol must be finite and 1e-15 at least, not 1e-16": {"rtol": 1e-16},
    r"iterations must be a whole number, 1 at least, not -1": {"iterations": -1},
    r"solimp must be dmin, dmax": {"solimp": (0.9, 1.5, 0.001, 0.5, 1.0)},
    r"cone must be one of pyramidal, elliptic, not 'round'": {"cone": "round"},
    r"impratio must be positive": {"impratio": 0.0},
    r"root must be one of shell, frame, not 'rotor'": {"root": "rotor"},
    r"error_tolerance must be positive": {"error_tolerance": -1.0},
    r"max_steps must be a whole number": {"max_steps": 0},
    r"drive must be a Servo or a Prescribed, not 3": {"drive": 3},
}


@pytest.mark.parametrize(("words", "changes"), BAD.items())
def test_settings_that_cannot_be_run_are_refused(words: str, changes: dict[str, Any]) -> None:
    """In one line that names the field, the value and what it may be."""
    with pytest.raises(rb.InputError, match=words):
        replace(FAST, **changes)


def test_what_mujoco_refuses_is_one_line() -> None:
    """A ball too light for MuJoCo, and a contact that carries nothing."""
    from validation.studies.random_runs import rescaled

    with pytest.raises(rb.InputError, match="MuJoCo refuses the model: "):
        rb.simulate(rescaled(FIG12, length=1e-9), settings="fast")
    with pytest.raises(rb.InputError, match="the contact cannot carry the ball at any depth"):
        rb.simulate(FIG12, settings=replace(FAST, solref=(0.0, -1e-300)))


NUMBER = st.floats() | st.floats(1e-4, 1e4)
SIZE = st.floats(-12, 12).map(lambda power: 10**power)
FIELD_VALUES: dict[str, st.SearchStrategy[Any]] = {
    "timestep": SIZE | NUMBER,
    "integrator": st.sampled_from([*OWN, ADAPTIVE, "rk5"]),
    "rtol": SIZE,
    "solver": st.sampled_from(["PGS", "CG", "Newton"]),
    "jacobian": st.sampled_from(["dense", "sparse", "auto"]),
    "iterations": st.integers(-1, 200),
    "tolerance": SIZE | NUMBER,
    "ls_tolerance": SIZE,
    "noslip_iterations": st.integers(-1, 20),
    "noslip_tolerance": SIZE,
    "cone": st.sampled_from(["pyramidal", "elliptic"]),
    "impratio": SIZE | NUMBER,
    "warmstart": st.sampled_from(["enable", "disable"]),
    "solref": st.tuples(NUMBER, NUMBER) | st.tuples(SIZE, SIZE),
    "solimp": st.tuples(*[st.floats(-0.1, 1.1)] * 5),
    "solreffriction": st.tuples(NUMBER, NUMBER)
    | st.tuples(SIZE, SIZE).map(lambda v: (-v[0], -v[1])),
    "condim": st.sampled_from([1, 3, 4, 6]),
    "sliding_friction": SIZE | NUMBER,
    "torsional_friction": SIZE,
    "rolling_friction": SIZE,
    "root": st.sampled_from(["shell", "frame"]),
    "start_in_equilibrium": st.booleans(),
    "stop_at_fault": st.booleans(),
    "drive": SIZE.map(lambda v: Servo(gain=v)) | SIZE.map(lambda v: Prescribed(armature=v)),
}
CHANGES = st.dictionaries(st.sampled_from(sorted(FIELD_VALUES)), st.none(), max_size=6).flatmap(
    lambda names: st.fixed_dictionaries({name: FIELD_VALUES[name] for name in names})
)
SCENES = [rb.load_scene(name) for name in ("fig12", "classical_regular", "chaplygin_ball")]


@pytest.mark.slow
@settings(max_examples=100)
@given(
    changes=CHANGES,
    scene=st.sampled_from(SCENES),
    naive=st.booleans(),
    gravity=SIZE,
    momentum=SIZE,
    rate=SIZE,
)
def test_any_settings_give_a_finite_motion_or_one_line(
    changes: dict[str, Any],
    scene: rb.Scene,
    naive: bool,
    gravity: float,
    momentum: float,
    rate: float,
) -> None:
    """Whatever the numbers: an InputError of one line, or finite samples up to where it ends."""
    base = rb.preset("naive") if naive else FAST
    start = replace(scene.start, momentum=scene.start.momentum * momentum)
    try:
        given = replace(base, max_steps=200, **changes)
        extreme_scene = replace(scene, gravity=gravity, start=start, frame_rate=2.0 * rate)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rb.SceneWarning)
            step = 0.01 if given.timestep is None else given.timestep
            motion = rb.simulate(extreme_scene, np.linspace(0.0, 20 * step, 3), given)
    except rb.InputError:  # one line by itself
        return
    for array in (motion.contact_point, motion.attitude, motion.momentum, motion.angular_velocity):
        assert np.isfinite(array).all()
        assert len(array) == len(motion.times)
    assert len(motion.times) == 3 or motion.report.faults
    assert all(np.isfinite(fault.time) for fault in motion.report.faults)


def test_a_run_that_ends_at_once_still_compares() -> None:
    """A fault at the very first state: no samples, no measures, a verdict."""
    slippery = replace(FAST, sliding_friction=0.2)
    agreement = compare(FIG12, slippery, np.linspace(0.0, 1.0, 11))
    assert len(agreement.motion.times) == 0
    assert agreement.path_error is None
    assert "t = 0 s" in agreement.verdict
