"""Settings: refusals, the recipe chosen from the load, and precedence of the user's values."""

import json
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.engines.mujoco.settings import (
    CONSTANT,
    INTEGRATORS,
    ORDER_8,
    OWN,
    VARYING,
    Prescribed,
    Radii,
    Resolved,
    settings_from,
)
from robotball.robot.motors import Servo
from robotball.robot.variations import scaled
from tests.messages import naming
from tests.robots import worked

FIG12, FAST, BALANCED = rb.load_scene("fig12"), rb.preset("fast"), rb.preset("balanced")

FACTORS = (0.98, 1.0, 1.02)  # of a limit
BAD: dict[str, dict[str, Any]] = {
    "integrator Euler implicit 'rk5'": {"integrator": "rk5"},
    "timestep 1e-50 1e+50 0.0": {"timestep": 0.0},
    "solref two": {"solref": (0.02, -1.0)},
    "sliding_friction -1.0": {"sliding_friction": -1.0},
    "condim 3 4 6 5": {"condim": 5},
    "RK8 timestep": {"integrator": ORDER_8, "timestep": None},
    "iterations 1 -1": {"iterations": -1},
    "solimp dmin dmax": {"solimp": (0.9, 1.5, 0.001, 0.5, 1.0)},
    "drive Servo Prescribed 3": {"drive": 3},
}


def changed(changes: dict[str, Any]) -> rb.Settings:
    return replace(FAST, **changes)


@pytest.mark.parametrize(("facts", "changes"), BAD.items())
def test_settings_that_cannot_be_run_are_refused(facts: str, changes: dict[str, Any]) -> None:
    """The error names the field, its value and the allowed values."""
    with pytest.raises(rb.InputError, match=naming(facts)):
        changed(changes)


def test_open_fields_come_from_the_recipe_for_a_constant_or_a_varying_load() -> None:
    """One recipe fills every open field of the settings."""
    inclined = replace(FIG12, gravity_direction=(np.sin(0.1), 0.0, -np.cos(0.1)))
    for scene in (FIG12, inclined):
        assert Resolved(scene, BALANCED).settings == replace(BALANCED, **CONSTANT)
        assert Resolved(scene, BALANCED).settings == replace(BALANCED, **CONSTANT)
    harder: dict[str, Any] = {"softness": 3e-4, "solref": (0.01, 1.0)}
    assert Resolved(worked("W5"), BALANCED).settings == replace(BALANCED, **VARYING, **harder)
    assert Resolved(worked("W5"), FAST).settings.solref == (0.04, 1.0)  # two timesteps
    exact = Resolved(worked("W5"), rb.preset("exact")).settings
    assert exact.solref == pytest.approx((0.02 / 3, 1.0))
    assert exact.noslip_iterations == 0


SET: list[dict[str, Any]] = [
    *({"iterations": 4}, {"sliding_friction": 0.3}, CONSTANT),
    *({name: value} for values in (CONSTANT, VARYING) for name, value in values.items()),
]


@pytest.mark.parametrize("scene", [worked("W5"), FIG12], ids=lambda scene: scene.name)
def test_fields_set_by_the_user_override_the_recipe(scene: rb.Scene) -> None:
    """Even if the value is in the recipe that the scene does not use."""
    for user_values in SET:
        chosen = Resolved(scene, replace(BALANCED, **user_values)).settings
        assert {name: getattr(chosen, name) for name in user_values} == user_values
        assert (
            Resolved(worked("W5"), chosen).settings is chosen
        )  # no open field: unchanged on another scene
    ran = rb.simulate(scene, np.array([0.0, 0.01]), settings=chosen).report.settings
    assert ran == chosen


def test_settings_survive_a_round_trip_through_json() -> None:
    """The record distinguishes radii from metres and a servo from an armature."""
    whole = Resolved(FIG12, FAST).settings
    assert whole.plain()["torsional_friction"] == {"radii": 20.0}
    for original in (FAST, whole, rb.preset("naive")):
        assert settings_from(json.loads(json.dumps(original.plain()))) == original
    wide = Resolved(scaled(FIG12, length=100.0), replace(FAST, torsional_friction=0.3))
    assert wide.friction[1] == 0.3
    with pytest.raises(rb.InputError, match=naming("-1.0")):
        replace(FAST, torsional_friction=Radii(-1.0))


NUMBER = st.floats() | st.floats(1e-4, 1e4)
SIZE = st.floats(-12, 12).map(lambda power: 10**power)
PAIR = st.tuples(NUMBER, NUMBER) | st.tuples(SIZE, SIZE)
FIELD_VALUES: dict[str, st.SearchStrategy[Any]] = {
    "integrator": st.sampled_from([*OWN, ORDER_8, "rk5"]),
    "solver": st.sampled_from(["PGS", "CG", "Newton"]),
    "cone": st.sampled_from(["pyramidal", "elliptic"]),
    "condim": st.sampled_from([1, 3, 4, 6]),
    "root": st.sampled_from(["shell", "frame"]),
    "start_in_equilibrium": st.booleans(),
    **dict.fromkeys(("torsional_friction", "rolling_friction"), SIZE),
    **dict.fromkeys(("timestep", "tolerance", "impratio", "sliding_friction"), SIZE | NUMBER),
    "iterations": st.integers(-1, 200),
    "noslip_iterations": st.integers(-1, 20),
    "solref": PAIR,
    "solimp": st.tuples(*[st.floats(-0.1, 1.1)] * 5),
    "solreffriction": PAIR | PAIR.map(lambda v: (-v[0], -v[1])),
    "drive": SIZE.map(lambda v: Servo(gain=v)) | SIZE.map(lambda v: Prescribed(armature=v)),
}
CHANGES = st.dictionaries(st.sampled_from(sorted(FIELD_VALUES)), st.none(), max_size=6).flatmap(
    lambda names: st.fixed_dictionaries({name: FIELD_VALUES[name] for name in names})
)
SCENES = [rb.load_scene(name) for name in ("fig12", "classical_regular", "chaplygin_ball")]


@settings(max_examples=25)
@given(CHANGES, st.sampled_from(SCENES), st.booleans(), st.tuples(SIZE, SIZE, SIZE))
def test_any_settings_give_a_finite_motion_or_an_input_error(
    changes: dict[str, Any], scene: rb.Scene, naive: bool, sizes: tuple[float, float, float]
) -> None:
    """All samples are finite; a run that ends early reports a fault."""
    base, (gravity, momentum, rate) = rb.preset("naive") if naive else FAST, sizes
    start = replace(scene.start, momentum=scene.start.momentum * momentum)
    try:
        run_settings = replace(base, max_steps=200, **changes)
        extreme_scene = replace(scene, gravity=gravity, start=start)
        extreme_scene = extreme_scene.with_hinges(command={"frame": 2.0 * rate})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rb.SceneWarning)
            step = 0.01 if run_settings.timestep is None else run_settings.timestep
            motion = rb.simulate(
                extreme_scene, np.linspace(0.0, 20 * step, 3), settings=run_settings
            )
    except rb.InputError:
        return
    for array in (motion.contact_point, motion.attitude, motion.momentum, motion.angular_velocity):
        assert np.isfinite(array).all()
    assert len(motion.times) == 3 or motion.report.faults
    assert all(np.isfinite(fault.time) for fault in motion.report.faults)


def test_stability_limits_of_rk4_are_where_its_amplification_is_one() -> None:
    """On both axes of z = λ dt, |1 + z + z²/2 + z³/6 + z⁴/24| = 1, and is larger beyond."""
    rk4 = INTEGRATORS["RK4"]
    on_imaginary_axis, on_real_axis = rk4.rotation_limit, rk4.friction_limit
    assert on_imaginary_axis is not None
    assert on_real_axis is not None
    assert on_real_axis == rk4.servo_limit
    for z in (1j * on_imaginary_axis, -on_real_axis):
        inside, at, beyond = (abs(np.polyval([1 / 24, 1 / 6, 1 / 2, 1, 1], f * z)) for f in FACTORS)
        assert at == pytest.approx(
            1, abs=2e-3
        )  # measured 1.1e-3 and 4.4e-4: limits have four digits
        assert inside < 1 < beyond
