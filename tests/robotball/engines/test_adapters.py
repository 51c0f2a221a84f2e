"""Each engine rolls the ball to the error that was measured of it, and says what it lacks.

A test of an engine runs where the engine is installed.
"""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engine import OURS
from robotball.engines.adapter import Adapter, SteppedWorld
from robotball.engines.links import State
from robotball.motion import momentum_error, path_error

EXTRAS = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"][
    "optional-dependencies"
]
ADAPTERS = {name: engine for name in OURS if isinstance(engine := rb.engine_named(name), Adapter)}
# engine, preset, field, value, scene: the path error measured over 2 s.
MEASURED = [
    ("pinocchio", "best", "rtol", 1e-12, "fig12", 9.9e-13),
    ("pinocchio", "RK4", "timestep", 20e-3, "fig12", 5.2e-8),
    ("drake", "ideal", "rtol", 1e-12, "fig12", 9.9e-13),
    ("drake", "tamsi", "timestep", 1e-3, "classical_regular", 6.5e-3),
    ("drake", "best", "timestep", 1e-3, "fig12", 4.2e-6),
    ("drake", "best", "timestep", 1e-3, "classical_regular", 5.6e-6),
    ("mujoco-warp", "best", "timestep", 20e-3, "fig12", 2.1e-6),
    ("exudyn", "best", "timestep", 5e-3, "fig12", 2.85e-5),
    ("exudyn", "contact", "timestep", 1e-3, "fig12", 1.5e-6),
    ("exudyn", "contact", "timestep", 1e-3, "classical_regular", 1.4e-6),
    ("dart", "ideal", "rtol", 1e-12, "fig12", 9.8e-13),
    ("dart", "best", "timestep", 1e-3, "classical_regular", 8.8e-3),
    ("physx", "best", "timestep", 1e-3, "classical_regular", 5.6e-3),
    ("newton", "best", "timestep", 20e-3, "fig12", 1.94e-6),
    ("newton", "kept", "timestep", 20e-3, "fig12", 8.4e-7),
    ("mjx", "best", "timestep", 20e-3, "fig12", 1.61e-4),
    ("pinocchio", "best", "rtol", 1e-12, "beaver_ball", 4.6e-13),
    ("pinocchio", "RK4", "timestep", 20e-3, "offset_routh_sphere", 3.6e-8),
    ("pinocchio", "RK4", "timestep", 20e-3, "inclined_plane", 7.9e-7),
]


def errors(
    name: str, preset: str, field: str, value: float, scene: str, duration: float = 2.0
) -> tuple[float, float]:
    """Of path and M."""
    engine = ADAPTERS[name]
    if not engine.installed:
        pytest.skip(f"needs the extra {engine.extra}")
    theory = rb.integrate(rb.load_scene(scene), rb.sample_times(duration))
    changes: dict[str, Any] = {field: value, "stop_at_fault": False}
    settings = replace(engine.presets[preset], **changes)
    motion = rb.simulate(theory.scene, theory.times, settings, engine=engine)
    return path_error(motion, theory), momentum_error(motion, theory)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "preset", "field", "value", "scene", "measured"), MEASURED)
def test_an_engine_errs_as_it_was_measured(
    name: str, preset: str, field: str, value: float, scene: str, measured: float
) -> None:
    """Neither more nor less, by a factor of 1.5: a better engine is news as well."""
    error, _ = errors(name, preset, field, value, scene)
    assert measured / 1.5 < error < measured * 1.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "preset"), [("bullet", "best"), ("drake", "tamsi"), ("genesis", "best")]
)
@pytest.mark.parametrize(
    ("scene", "path", "momentum"),
    [("fig12", 3.68e-3, 1.107e-2), ("classical_regular", 3.75e-2, 2.10e-2)],
)
def test_first_order_engines_share_their_error(
    name: str, preset: str, scene: str, path: float, momentum: float
) -> None:
    """That of MuJoCo's Euler and implicitfast at 1 ms: it is of the time stepping, not the contact.

    Two digits, of M in both models, and of the path where no torque of ours stands for friction.
    """
    error, of_momentum = errors(name, preset, "timestep", 1e-3, scene, 10.0)
    assert of_momentum == pytest.approx(momentum, rel=0.01)
    if (name, scene) == ("drake", "fig12"):
        assert error == pytest.approx(8.5e-3, rel=0.05)  # the rest is the spin that is let through
    else:
        assert error == pytest.approx(path, rel=0.01)


@pytest.mark.parametrize("name", ADAPTERS)
def test_an_adapter_is_told_without_its_package(name: str) -> None:
    """Presets, ladders, the extra and what it asks for are known where nothing is installed."""
    engine = ADAPTERS[name]
    assert tuple(EXTRAS[engine.extra]) == engine.requirements
    assert engine.default in engine.presets
    assert set(engine.ladders) <= set(engine.presets)
    for preset, (field, _) in engine.ladders.items():
        assert hasattr(engine.presets[preset], field)


@pytest.mark.parametrize("name", ADAPTERS)
def test_a_package_that_is_missing_is_one_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It names the extra."""
    monkeypatch.setattr("robotball.engines.adapter.find_spec", lambda _: None)
    with pytest.raises(rb.InputError, match=rf"pip install 'robotball\[{name}\]'"):
        rb.simulate(rb.load_scene("fig12"), engine=name)


def test_a_motor_of_the_scenes_own_is_refused_before_the_run() -> None:
    """With the reason."""
    with pytest.raises(rb.InputError, match="turns hinges at given rates"):
        rb.simulate(rb.load_scene("servo_motors"), engine="bullet")


@pytest.mark.parametrize(
    ("scene", "why"), [("servo_motors", "a hinge has a motor"), ("beaver_ball", None)]
)
def test_dynamics_under_our_constraints_roll_what_is_not_balanced(
    scene: str, why: str | None
) -> None:
    """Of Pinocchio: its rows above say how well; a motor is beyond it."""
    told = ADAPTERS["pinocchio"].cannot_express(rb.load_scene(scene))
    assert told is None if why is None else why in (told or "")


class Equal(SteppedWorld):
    """An engine of equal steps that only counts them."""

    def control(self, t: float, step: float) -> None: ...

    def step(self, step: float) -> None: ...

    def state(self) -> State:
        return self.now


def test_equal_steps_end_on_every_sample() -> None:
    """Two steps and a half are refused, in one line, and three are not."""
    world = Equal(rb.load_scene("fig12"))
    assert len(list(world.march(np.array([0.0, 0.1, 0.2, 0.3]), 0.1))) == 3
    with pytest.raises(rb.InputError, match="steps are all equal"):
        list(world.march(np.array([0.0, 0.1, 0.2, 0.25]), 0.1))


def test_torsional_friction_that_is_not_there_is_told_before_the_run() -> None:
    """Of Drake's point contact."""
    engine, rubber = ADAPTERS["drake"], rb.load_scene("fig12")
    for preset, said in (("as-it-comes", "spins freely"), ("best", "a torque of ours")):
        lack = engine.lacks(rubber, engine.presets[preset])
        assert lack is not None
        assert said in lack
    assert engine.lacks(rb.load_scene("classical_regular"), engine.presets["best"]) is None
    assert engine.lacks(rubber, engine.presets["ideal"]) is None


def bullet() -> Adapter:
    if not ADAPTERS["bullet"].installed:
        pytest.skip("needs the extra bullet")
    return ADAPTERS["bullet"]


def test_bullet_at_its_best_is_of_first_order() -> None:
    """A fifth of the step makes a fifth of the error, of the path and of M."""
    steps = (5e-3, 1e-3)
    coarse, fine = (errors("bullet", "best", "timestep", step, "fig12") for step in steps)
    assert np.divide(coarse, fine) == pytest.approx([5, 5], rel=0.2)


def test_bullet_as_it_comes_cuts_the_rotors_rate() -> None:
    """Every hinge at 100 rad/s at most, in silence: the rotor's 148 are off by a third."""
    scene = rb.load_scene("fig12")
    motion = rb.simulate(scene, rb.sample_times(0.2), "as-it-comes", engine=bullet())
    assert motion.hinge_rates[-1, 1] == pytest.approx(100, abs=1)
    assert motion.report.faults[0].kind is rb.FaultKind.RATE_OFF
