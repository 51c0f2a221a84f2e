"""The contact for slipping: MuJoCo against the equations of a ball with finite friction."""

import re
from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.run import exceeded
from robotball.engines.mujoco.settings import Resolved
from robotball.engines.mujoco.special_limits import late_friction
from robotball.robot.motors import Servo
from robotball.robot.scene import Friction
from robotball.view.render import Film, _notes
from tests.imports import PROJECT
from tests.messages import naming, unnamed
from tests.robotball.theory.test_friction import regular, sphere
from validation import compare
from validation.comparing import note_of
from validation.results import controlled

pytestmark = pytest.mark.core

SLIDING = sphere((2.0, 0.0), (10.0, 5.0, 0.0), Friction(0.3))
SPINNING = sphere((0.0, 0.0), (0.0, 0.0, 5.0), Friction(None, 0.005), "rubber")
FIG12 = replace(rb.load_scene("fig12"), friction=Friction(1.0, 0.5))


def in_steps(scene: rb.Scene, timestep: float, time: float) -> tuple[float, float]:
    """Return the path error and the attitude error [rad] of MuJoCo in steps [s]."""
    settings = replace(rb.preset("accurate"), timestep=timestep)
    agreement = compare(scene, time, settings=settings)
    assert agreement.agrees, agreement.verdict
    return agreement.path_error, agreement.attitude_error


def test_a_sliding_sphere_sticks_in_time() -> None:
    """Order 2, because the slip keeps its direction: measured 2.9e-7 at 1 ms, 1.07e-6 at 2 ms.

    With MuJoCo's defaults it is 1.1e-2 at any timestep.
    """
    (coarse, _), (fine, _) = (in_steps(SLIDING, step, 1.0) for step in (2e-3, 1e-3))
    assert fine < 5e-7
    assert coarse / fine == pytest.approx(4, rel=0.2)
    assert compare(SLIDING, 1.0, settings="naive").path_error > 5e-3


def test_a_spinning_sphere_stops_in_time() -> None:
    """Measured 1.3e-6 rad at 1 ms of a rotation of 1.02 rad. The end of the spin causes 1e-6."""
    _, error = in_steps(SPINNING, 1e-3, 1.0)
    assert error < 2e-6


ON_PAGE = {
    "a sphere that slides and then rolls, friction 0.3, 1 s": (SLIDING, 1.0),
    "classical_regular, friction 0.3, 3 s": (regular(0.3), 3.0),
    "classical_regular, friction 0.6, 3 s": (regular(0.6), 3.0),
    "fig12, friction 1 and 0.5 m, 2 s": (FIG12, 2.0),
}


@pytest.mark.parametrize("motion", ON_PAGE)
def test_the_settings_page_has_the_errors_of_a_slip(motion: str) -> None:
    """Half a step of 1 ms has half the error, because friction is against the slip 0.4 of a step
    ahead. A straight slip has a quarter. Measured within 4 % of that.
    """
    page = (PROJECT / "docs" / "settings.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| {motion} \| (.*) \|$", page, re.M)
    *shown, predicted = map(float, row.split("|"))
    scene, time = ON_PAGE[motion]
    theory, errors = rb.integrate(scene, time), []
    for step in (5e-3, 1e-3, 5e-4):
        settings = replace(rb.preset("accurate"), timestep=step)
        errors.append(compare(scene, time, settings=settings, theory=theory).path_error)
    assert errors == pytest.approx(shown, rel=0.1)
    check = late_friction(PlannedRun(scene, rb.preset("accurate"), time, theory.loads))
    assert check is not None
    assert check.value == pytest.approx(predicted, rel=0.1, abs=1e-12)
    assert errors[1] / errors[2] == pytest.approx(2 if predicted else 4, rel=0.1)


def test_servos_drive_a_ball_that_slips() -> None:
    """With gains of 1 N m s; measured 5.5e-6 at 1 ms."""
    scene = regular(0.3)
    motors = [Servo(1.0)] * len(scene.ball.hinges)
    driven = replace(scene, ball=scene.ball.with_hinges(motor=motors))
    assert in_steps(driven, 1e-3, 3.0)[0] < 1e-5


@pytest.mark.parametrize("preset", ["balanced", "efficient"])
@pytest.mark.parametrize("name", ["classical_regular", "steered_pendulum_robot"])
def test_a_friction_that_suffices_changes_nothing_of_the_run(name: str, preset: str) -> None:
    """With a cone as small as the scene's, Newton's method and noslip lifted the robot off."""
    scene = rb.load_scene(name)
    free = rb.simulate(scene, 4.0, settings=preset)
    needed = float(free.loads.sliding_friction.max())
    sticky = replace(scene, friction=rb.Friction(sliding=1.5 * needed))
    assert Resolved(sticky, rb.preset(preset)).settings.slips is False
    motion = rb.simulate(sticky, 4.0, settings=preset)
    assert not motion.report.faults
    assert np.array_equal(motion.contact_point, free.contact_point)
    assert motion.report.friction_used.max() == pytest.approx(1 / 1.5, rel=1e-6)


def test_a_value_of_the_contact_that_is_given_is_kept_and_warned_of() -> None:
    """The contact for rolling loses the plane after 0.025 s of slip."""
    given = replace(rb.preset("balanced"), impratio=1.0)
    resolved = Resolved(regular(0.3), given).settings
    assert (resolved.slips, resolved.impratio) == (None, 1.0)
    with pytest.warns(rb.SceneWarning, match=naming("slips friction.sliding 0.3 Coulomb")):
        agreement = compare(regular(0.3), 3.0, settings=given)
    assert [fault.kind for fault in agreement.faults] == [rb.FaultKind.CONTACT_LOST]


def test_the_error_of_late_friction_is_predicted() -> None:
    """Measured 0.14 of the prediction at 0.3 and 0.04 at 0.6, where sticking ends the error."""
    times = np.linspace(0.0, 3.0, 151)
    for mu, least in ((0.3, 0.1), (0.6, 0.01)):
        scene = regular(mu)
        loads = rb.integrate(scene, times).loads
        settings = replace(rb.preset("accurate"), error_tolerance=1e-6)
        check = late_friction(PlannedRun(scene, settings, 3.0, loads))
        assert check is not None
        error = compare(scene, times, settings="accurate").path_error
        assert least * check.value < error < 1.5 * check.value


def test_a_servo_that_a_slipping_shell_cannot_hold_is_predicted() -> None:
    """A spinning shell resists the servos of servo_motors six times less than a rolling one.

    In steps of 5 ms it leaves the plane at 0.01 s.
    """
    scene = rb.load_scene("servo_motors")
    slipping = replace(scene, friction=Friction(0.7, 1.1))
    times = np.linspace(0.0, 0.1, 6)
    assert not exceeded(scene, rb.preset("balanced"), times)
    line = exceeded(slipping, rb.preset("balanced"), times)["servo_gain"].warning
    assert unnamed("12.4 2.785", line) == []


def test_the_distance_of_default_settings_is_split_into_friction_and_engine() -> None:
    """fig12 over 2 s: friction 1 and 5 mm change the path by 0.42, and MuJoCo errs by 0.28."""
    slip = compare("fig12", 2.0, settings="naive").slip
    assert slip is not None
    assert (slip.sliding, slip.torsional, slip.of_settings) == (1.0, 0.005, True)
    assert slip.needed_sliding == pytest.approx(1.155, abs=1e-3)
    assert slip.needed_torsional == pytest.approx(1.873, abs=1e-3)
    assert slip.by_friction == pytest.approx(0.42, abs=0.01)
    assert slip.by_engine == pytest.approx(0.28, abs=0.03)
    assert unnamed("1 1.15 0.005~m 1.87~m 0~to~2~s 42~% 28~%", str(slip)) == []


def test_a_film_of_default_settings_says_what_their_friction_does() -> None:
    """There is no note for enough friction, or for a scene's friction: the equations slip too."""
    naive, fast = (compare("fig12", 2.0, settings=name) for name in ("naive", "fast"))
    assert unnamed("friction 42~%", note_of([naive, fast])) == []
    assert note_of([fast]) == note_of([compare(regular(0.3), 1.0, settings="fast")]) == ""
    assert note_of([naive]) in [
        *_notes([naive.motion, naive.theory], Film(note=note_of([naive])), {})
    ]


def test_the_slip_of_a_scene_has_the_friction_that_ideal_rolling_needs() -> None:
    """The engine is compared with the slipping ball, so the text omits its path error."""
    agreement = compare(regular(0.3), 3.0, settings="fast")
    slip = agreement.slip
    assert slip is not None
    assert slip.by_engine == agreement.path_error
    assert unnamed("0.3 0.991 0~to~0.86~s 1.69~to~2.24~s 21~%", str(slip)) == []
    assert compare(regular(1.1), 1.0, settings="fast").slip is None


@pytest.mark.parametrize("text", [("x",), ("1", "0.5", "3")])
def test_an_option_of_friction_that_is_not_one_or_two_numbers_is_refused(
    text: tuple[str, ...],
) -> None:
    with pytest.raises(rb.InputError, match=naming("--friction SLIDING,TORSIONAL")):
        controlled("fig12", friction=text)


def test_an_option_of_friction_replaces_the_scenes_limits() -> None:
    scene = controlled("fig12", friction=("1", "0.5"))
    assert (scene.name, scene.friction) == ("fig12-friction-1-0.5", Friction(1.0, 0.5))
    assert controlled("fig12", friction=("1",)).friction == Friction(1.0)
