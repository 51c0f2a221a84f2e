"""Fits recover numbers from logs, and report undetermined ones."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import robotball as rb
from robotball.fit import fitting
from robotball.fit.first import first_values
from robotball.fit.residuals import Residuals, held, of_log, of_scene
from robotball.fit.scene_numbers import numbers_of
from robotball.fit.sensing import apart, contradictions, noise_of, stands_still, times_of
from robotball.motion import Motion
from robotball.robot.scene import Friction
from robotball.rotations import turned
from robotball.scene_files.scene_file import CATALOG
from tests.imports import PROJECT
from tests.messages import naming, unnamed, untold
from tests.robotball.scene_files.scene_texts import scene_of
from tests.robotball.theory.test_friction import regular, sphere
from tests.robots import with_frame

NOISE = {"position": 1e-3, "attitude": 1e-2, "gyro": 2e-2}
END = 3.0


@cache
def motion(rate: float = 50.0) -> Motion:
    """Return the pendulum robot's motion in MuJoCo, with an almost ideal contact."""
    return rb.simulate("pendulum_robot", rb.sample_times(END, 1 / rate), settings="balanced")


def log(seed: int = 0, of: Motion | None = None, name: str = "run.csv") -> rb.Log:
    """Return a log of a motion: positions, attitudes and a gyro, with noise."""
    m, rng = of or motion(), np.random.default_rng(seed)
    noisy = [rng.normal(0.0, size, (len(m.times), 3)) for size in NOISE.values()]
    return rb.Log(
        name,
        (
            rb.Sensor("position", m.times, m.contact_point + noisy[0][:, :2]),
            rb.Sensor("attitude", m.times, turned(m.attitude, noisy[1])),
            rb.Sensor("gyro", m.times, m.angular_velocity + noisy[2]),
        ),
        {},
    )


def off(folder: Path, **wrong: float) -> Path:
    """Return the scene file with some of its numbers multiplied."""
    numbers = numbers_of("pendulum_robot")
    paths = {numbers.path_of(name.replace("__", ".")): f for name, f in wrong.items()}
    values = {path: factor * numbers.known[path].value for path, factor in paths.items()}
    path = folder / "off.toml"
    path.write_text(numbers.text(values, numbers.scene(values)), encoding="utf-8")
    return path


def test_numbers_are_recovered_from_a_guess_that_is_30_percent_off(tmp_path: Path) -> None:
    """Each within three deviations; χ² is explained by the noise."""
    scene = off(tmp_path, battery__mass=1.3, battery__centre__z=0.75, frame__kv=0.7)
    result = rb.fit(scene, [log()], ["battery.mass", "battery.centre.z", "kv"], noise=NOISE)
    truth = (1.1, -0.085, 0.4)
    for estimate, value in zip(result.found, truth, strict=True):
        # Measured at most 1.6 deviations, from the noise of the log.
        assert abs(estimate.value - value) < 3 * estimate.deviation
        assert estimate.deviation < 0.02 * abs(value)  # measured at most 0.012
    assert result.explains
    assert abs(result.chi2 / result.degrees - 1) < 4 * np.sqrt(2 / result.degrees)
    assert rb.load_scene(off(tmp_path)).ball.radius == result.scene.ball.radius
    (tmp_path / "fitted.toml").write_text(result.text, encoding="utf-8")
    assert rb.load_scene(tmp_path / "fitted.toml").start == result.scene.start


SHORT = rb.sample_times(1.5, 1 / 30)


def with_dc_motor(text: str) -> str:
    """Return the scene file with a DC motor, whose torque is a product of its numbers."""
    begin, end = text.index('drive = "servo"'), text.index("armature =")
    motor = 'drive = "dc_motor"\nsupply = -0.5\nstall_torque = 1.2\nno_load_speed = 8.0\n'
    return (
        text[:begin]
        + motor
        + "efficiency = 0.7\n"
        + text[end:].replace("armature", "rotor_inertia", 1)
    )


UNTOLD: Mapping[str, tuple[list[str], list[str], str]] = {
    "a limit never reached": (["frame.torque_limit"], [], "frame.torque_limit"),
    "a wall's density and thickness": (
        ["shell.density", "shell.thickness"],
        [],
        "shell.density~×~shell.thickness",
    ),
    "a motor's torque and its gear's loss": (
        ["stall_torque", "efficiency"],
        [],
        "frame.stall_torque~×~frame.efficiency",
    ),
    "a world beside the start": (["kv"], ["world.yaw"], "run.csv world.yaw level heading"),
    "an encoder's zero beside its angle": (
        ["kv"],
        ["frame_angle.zero"],
        "run.csv frame_angle.zero",
    ),
}


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=pytest.mark.study if i % 2 else ()) for i, c in enumerate(UNTOLD)],
)
def test_undetermined_numbers_are_reported(case: str, tmp_path: Path) -> None:
    """Numbers and circumstances without effect, and products of which only one is determined."""
    free, circumstances, facts = UNTOLD[case]
    text = (CATALOG / "pendulum_robot.toml").read_text(encoding="utf-8")
    path = tmp_path / "robot.toml"
    path.write_text(with_dc_motor(text) if "efficiency" in free else text, encoding="utf-8")
    m = rb.integrate(path, SHORT, 1e-9)
    encoder = rb.Sensor("frame_angle", SHORT, m.hinge_angles + 0.1 * NOISE["attitude"])
    made = replace(log(of=m), sensors=(*log(of=m).sensors, encoder))
    noise = {**NOISE, "frame_angle": NOISE["attitude"]}
    result = rb.fit(path, [made], free, circumstances=circumstances, noise=noise)
    assert any(not unnamed(facts, line) for line in result.undetermined), result.undetermined
    assert result.explains


SLIDING = with_frame(sphere((3.09, 0.0), (0.0, 0.0, 0.0), Friction(0.3)))  # for 0.3 s
SPINNING = with_frame(sphere((0.0, 0.0), (0.0, 0.0, 5.0), Friction(None, 0.005), "rubber"))


def rolling_start(scene: rb.Scene, factor: float) -> rb.Scene:
    """Return the scene with other limits of friction, and a start that rolls."""
    sliding, torsional = (
        limit and factor * limit for limit in (scene.friction.sliding, scene.friction.torsional)
    )
    start = replace(scene.start, slip=np.zeros(3))
    return replace(scene, friction=Friction(sliding, torsional), start=start)


@pytest.mark.parametrize(
    ("truth", "kind", "factor"),
    [(SLIDING, "sliding", 0.5), (SLIDING, "sliding", 2.0), (SPINNING, "torsional", 2.0)],
)
def test_a_friction_and_the_slip_of_the_start_are_recovered(
    truth: rb.Scene, kind: str, factor: float
) -> None:
    """The ball slides or spins first and rolls later; the guess rolls from the start.

    In 16 logs with other starts and frictions, errors are 1.15 deviations on average.
    """
    made = log(of=rb.integrate(truth, rb.sample_times(1.0, 0.02)))
    result = rb.fit(rolling_start(truth, factor), [made], [f"friction.{kind}"], noise=NOISE)
    assert result.explains
    (found,) = result.found
    limit = getattr(truth.friction, kind)
    # Measured 0.8 and 1.0 deviations, from the noise of the log, and a deviation of 0.3 %.
    assert abs(found.value - limit) < 3 * found.deviation < 0.02 * limit
    assert found.determined
    slips = {estimate.name: estimate for estimate in result.of_logs}
    assert slips
    for name, slip in slips.items():  # measured at most 1.6 deviations
        true = truth.start.slip["xyz".index(name[-1])]
        assert abs(slip.value - true) < 3 * slip.deviation
    assert scene_of(result.text).start == result.scene.start


@pytest.mark.parametrize("factor", [0.7, 2.0])
def test_a_friction_that_is_not_reached_has_a_lower_bound(factor: float) -> None:
    """The log rolls without slipping, and any higher friction explains it as well."""
    robot = rb.load_scene("classical_regular")
    rolled = rb.integrate(robot, SHORT)
    need = float(rolled.loads.sliding_friction.max())
    guess = replace(robot, friction=Friction(factor * need))
    result = rb.fit(guess, [log(of=rolled)], ["friction.sliding"], noise=NOISE)
    assert result.explains
    assert not result.found[0].determined
    *_, bound = result.undetermined
    assert unnamed("friction.sliding at~least need", bound) == []
    # Measured 0.925 and 0.929, with the noise of the start.
    assert float(bound.split("about ")[1].split(",")[0]) == pytest.approx(need, rel=0.02)


def test_the_need_of_a_ball_that_sticks_is_not_the_friction_of_its_slip() -> None:
    """A sphere that slides needs all its friction, and none when it rolls straight."""
    scene = rolling_start(SLIDING, 1.0)
    sensed = first_values(scene, log(of=rb.integrate(SLIDING, SHORT)), NOISE, ())
    numbers = numbers_of(scene)
    unknowns = of_scene(numbers, ["friction.sliding"], scene.ball.radius)
    unknowns += of_log(sensed, 0, [])
    residuals = Residuals(numbers, unknowns, [sensed], {})
    x = np.zeros(len(unknowns))
    assert residuals.needs(x)[0] == pytest.approx(0.3, abs=1e-9)
    assert residuals.needs(x, sticking=True)[0] < 1e-9


def test_a_fast_ball_that_rolls_does_not_start_with_slip() -> None:
    """It turns by 0.2 rad during the first readings.

    With the attitude of the first one, their velocity seemed to slip by 1 m/s.
    """
    scene = replace(rb.load_scene("fig12"), friction=Friction(20.0, 20.0))
    made = log(of=rb.integrate(scene, rb.sample_times(0.5, 0.02)))
    assert not first_values(scene, made, NOISE, ()).start.start.slips


@pytest.mark.slow
def test_a_first_friction_that_is_not_reached_is_lowered() -> None:
    """At twice the friction the motion does not slip, so χ² does not depend on it."""
    truth = regular(0.6)
    made = log(of=rb.integrate(truth, SHORT))
    result = rb.fit(rolling_start(truth, 2.0), [made], ["friction.sliding"], noise=NOISE)
    assert result.explains
    (found,) = result.found
    assert abs(found.value - 0.6) < 3 * found.deviation < 0.02  # measured 0.8 deviations of 2e-4


def slipping(scene: rb.Scene) -> Motion:
    """Return the motion on a plane so smooth that the shell slips, which the report says."""
    smooth = replace(scene, friction=replace(scene.friction, sliding=0.02))
    settings = replace(rb.preset("balanced"), stop_at_fault=False)
    return rb.simulate(smooth, SHORT, settings=settings)


def with_rotor(scene: rb.Scene) -> Motion:
    """Return the motion with a rotor that the model does not have."""
    rotor = rb.Rotor(
        0.1, axial_inertia=2e-4, transverse_inertia=1e-4, axis=np.array([1.0, 0.0, 0.0])
    )
    ball = replace(scene.ball, hinges=(*scene.ball.hinges, rb.Hinge(rotor, 200.0)))
    return rb.integrate(replace(scene, ball=ball), SHORT, 1e-9)


WRONG: Mapping[str, Callable[[rb.Scene], Motion]] = {
    "another rolling model": lambda s: rb.integrate(replace(s, rolling="classical"), SHORT, 1e-9),
    "a rotor that is missing": with_rotor,
    "a start that slips": slipping,
    "a floor that is tilted": lambda s: rb.integrate(
        replace(s, gravity_direction=(np.sin(0.01), 0.0, -np.cos(0.01))), SHORT, 1e-9
    ),
    "a resistance that is missing": lambda s: rb.integrate(
        replace(s, friction=replace(s.friction, rolling=2e-3)), SHORT, 1e-9
    ),
}


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=pytest.mark.study if i % 2 else ()) for i, c in enumerate(WRONG)]
)
def test_a_wrong_model_is_rejected(case: str) -> None:
    """Because of χ²; the report names the sensor and the time from which it strays."""
    robot = rb.load_scene("pendulum_robot").with_hinges(command={"frame": rb.Ramp(final=-4, end=1)})
    result = rb.fit(robot, [log(of=WRONG[case](robot))], ["kv"], noise=NOISE)
    assert not result.explains
    assert result.strays[0].since is not None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "factor"),
    [("gyro", -1.0), pytest.param("position", 100.0, marks=pytest.mark.study)],
)
def test_sensors_that_contradict_each_other_are_named(name: str, factor: float) -> None:
    """A gyro of the wrong sign, or positions in cm, contradict the other sensors."""
    made = log(of=rb.integrate("pendulum_robot", SHORT, 1e-9))
    wrong = [replace(s, values=factor * s.values) if s.name == name else s for s in made.sensors]
    result = rb.fit("pendulum_robot", [replace(made, sensors=tuple(wrong))], ["kv"], noise=NOISE)
    # The sensor that it contradicts strays, too: measured at least 5 deviations, of the attitude.
    assert {"attitude", name} <= {sensor.name for sensor in result.strays}
    # Gyro and attitude are compared without a model; positions in cm contradict the rolling.
    said = "gyro and attitude of run.csv contradict each other with any model: "
    assert [line.startswith(said) for line in result.contradictions] == [True] * (name == "gyro")


KINEMATICS: Mapping[str, tuple[Callable[[np.ndarray], np.ndarray], str | None]] = {
    "right": (lambda w: w, None),
    "a bias": (lambda w: w + 0.2, None),
    "the other sign": (lambda w: -w, "-x, -y, -z"),
    "deg/s for rad/s": (np.degrees, ""),
    "rad/s for deg/s": (np.radians, ""),
    "swapped axes": (lambda w: w[:, [1, 0, 2]], "y, x, z"),
}


@pytest.mark.parametrize("case", KINEMATICS)
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_gyro_and_attitude_are_compared_without_a_model(case: str, rate: float) -> None:
    """They differ by 0.10 of the rotation if correct, even with a bias, otherwise by 0.97.

    The axes are named for which they agree.
    """
    wrong, said = KINEMATICS[case]
    sensors = {sensor.name: sensor for sensor in log(of=motion(rate)).sensors}
    sensors["gyro"] = replace(sensors["gyro"], values=wrong(sensors["gyro"].values))
    assert [*contradictions(sensors)] == [
        ("gyro", "attitude", axes) for axes in [said] if said is not None
    ]
    # A gyro on the shell measures another body than the attitude does.
    sensors["shell_gyro"] = replace(sensors.pop("gyro"), name="shell_gyro")
    assert not [*contradictions(sensors)]


def standing() -> rb.Log:
    """Return a log of a robot at rest whose motor is commanded to stay at rest."""
    rng, rest = np.random.default_rng(0), np.tile([1.0, 0.0, 0.0, 0.0], (len(SHORT), 1))
    noisy = [rng.normal(0.0, size, (len(SHORT), 3)) for size in NOISE.values()]
    values = (noisy[0][:, :2], turned(rest, noisy[1]), noisy[2])
    sensors = tuple(rb.Sensor(name, SHORT, v) for name, v in zip(NOISE, values, strict=True))
    return rb.Log("run.csv", sensors, {"frame": (SHORT[:1], np.zeros(1))})


def test_a_log_of_a_robot_at_rest_determines_nothing() -> None:
    """The report says so, although some numbers may be fitted to the noise."""
    assert not stands_still({sensor.name: sensor for sensor in log().sensors})
    result = rb.fit("pendulum_robot", [standing()], ["kv", "battery.mass"], noise=NOISE)
    assert unnamed("run.csv readings constant", result.undetermined[0]) == []
    assert not any(estimate.determined for estimate in result.found)


@pytest.mark.parametrize(("swing", "determined"), [(0.0, False), (0.1, True)])
def test_a_gain_is_not_determined_by_a_rate_that_is_noise(swing: float, determined: bool) -> None:
    """With the motor held at 0, sideways rocking does not move the hinge; swinging does.

    For rocking, the gain's linearised deviation is 0.05; but with another start rate, χ² rises by
    only 0.2 instead of 9 if the gain is off by three deviations. For swinging it rises by 7.6.
    """
    robot = rb.load_scene("pendulum_robot").with_hinges(command={"frame": 0.0})
    tilted = turned(robot.start.attitude, np.array([0.0, swing, 0.0]))
    robot = replace(robot, start=rb.Start(tilted, np.zeros(3)))
    made = replace(
        log(5, of=rb.integrate(robot, SHORT, 1e-9)), commands={"frame": (SHORT[:1], np.zeros(1))}
    )
    result = rb.fit("pendulum_robot", [made], ["kv"], noise=NOISE)
    (kv,) = result.found
    assert result.explains
    assert kv.determined == determined == (not result.undetermined)
    assert abs(kv.value - 0.4) < 3 * kv.deviation  # measured 0.3 and 1.7 of them
    # Measured 0.22, after doubling the linearised deviation twice, and 0.011.
    assert (kv.deviation < 0.05) == determined


def test_a_number_that_ends_at_its_limit_is_reported(tmp_path: Path) -> None:
    """The true gain of 0.4 is outside its limits 0.45 to 0.6."""
    result = rb.fit(off(tmp_path, kv=1.2), [log()], ["kv=0.45:0.6"], noise=NOISE)
    assert untold(["frame.kv limit 0.45"], result.at_limits) == []


@pytest.mark.parametrize(
    ("readings", "facts"),
    [
        (np.full((9, 2), 0.3), "position constant noise"),
        (np.arange(8.0).reshape(4, 2), "position 4 noise"),
    ],
)
def test_readings_without_a_measurable_noise_are_refused(readings: np.ndarray, facts: str) -> None:
    """A constant sensor, or one with too few readings."""
    made = rb.Log("run.csv", (rb.Sensor("position", np.arange(len(readings)) / 10, readings),), {})
    with pytest.raises(rb.InputError, match=naming(f"run.csv {facts}")):
        rb.fit("pendulum_robot", [made], ["kv"])


def test_a_correct_model_is_not_rejected() -> None:
    """As a control, the logs of the rejected models, but from the correct model."""
    robot = rb.load_scene("pendulum_robot").with_hinges(command={"frame": rb.Ramp(final=-4, end=1)})
    result = rb.fit(robot, [log(of=rb.integrate(robot, SHORT, 1e-9))], ["kv"], noise=NOISE)
    assert result.explains


def test_a_log_without_noise_is_explained() -> None:
    """Errors of equations and engines, 3e-9 for an attitude, do not reject a correct model."""
    m = rb.simulate("pendulum_robot", rb.sample_times(2.0, 0.02), settings="accurate")
    exact = rb.Log("run.csv", (rb.Sensor("attitude", m.times, m.attitude),), {})
    result = rb.fit("pendulum_robot", [exact], ["kv"])
    assert result.explains
    assert result.found[0].value == pytest.approx(0.4, abs=1e-7)


@pytest.mark.slow
def test_a_log_computed_with_the_equations_is_explained(tmp_path: Path) -> None:
    """The integration error of a fit is below the least noise that it assumes."""
    robot = rb.load_scene("pendulum_robot")
    rb.integrate(robot, rb.sample_times(END, 0.02)).save(tmp_path / "own.csv")
    exact = rb.read_log(tmp_path / "own.csv", robot)
    result = rb.fit("pendulum_robot", [exact], ["kv"])
    assert result.explains
    assert result.chi2 < 0.1 * result.degrees  # measured 6e-8
    assert result.found[0].value == pytest.approx(0.4, abs=1e-7)
    assert not result.influences


def with_accelerometer() -> rb.Log:
    """Return a log with gyro and accelerometer, whose differences make derivatives inaccurate."""
    times, rng = rb.sample_times(2.0, 0.02), np.random.default_rng(99)
    sensor = rb.Sensor("accelerometer", times, np.zeros((len(times), 3)))
    at = times_of(sensor, {})
    m = rb.integrate("pendulum_robot", np.unique(at), 1e-12)
    force = -apart(sensor, m, np.searchsorted(m.times, at), {})
    gyro = m.angular_velocity[np.searchsorted(m.times, times)]
    gyro = gyro + np.random.default_rng(0).normal(0.0, NOISE["gyro"], gyro.shape)
    noisy = replace(sensor, values=force + rng.normal(0.0, 0.1, force.shape))
    return rb.Log("run.csv", (rb.Sensor("gyro", times, gyro), noisy), {})


@pytest.mark.slow
def test_a_fit_stops_if_no_step_lowers_chi2() -> None:
    """The predicted decrease of χ² is over 1 because of rounding, and does not keep it going."""
    noise = {"gyro": NOISE["gyro"], "accelerometer": 0.1}
    assert rb.fit("pendulum_robot", [with_accelerometer()], ["kv"], noise=noise).complete


@pytest.mark.slow
def test_a_fit_with_too_few_trials_reports_that_it_is_incomplete(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One trial for each part of the log, and one last step."""
    monkeypatch.setattr(fitting, "_MOST_TRIALS", 1)
    monkeypatch.setattr(fitting, "_LAST_STEPS", 1)
    scene = off(tmp_path, battery__mass=1.3, kv=0.7)
    assert not rb.fit(scene, [log()], ["battery.mass", "kv"], noise=NOISE).complete


@pytest.mark.parametrize("noise", [np.inf, np.nan, 0.0, -1.0])
def test_a_noise_must_be_positive_and_finite(noise: float) -> None:
    """The message names the sensor and the value, before the fit starts."""
    with pytest.raises(rb.InputError, match=naming(f"noise gyro {noise:g}")):
        rb.fit("pendulum_robot", [log()], ["kv"], noise={"gyro": noise})


@pytest.mark.parametrize("name", ["gyro", "frame_rate"])
def test_a_log_with_an_impossible_start_is_distinguished_from_a_scene_without_motion(
    name: str,
) -> None:
    """The readings are noise of 150 rad/s, at which the ball would lift off: the log is wrong."""
    values = np.random.default_rng(1).normal(0.0, 150.0, (len(SHORT), 3 if name == "gyro" else 1))
    noise = rb.Log("noise.csv", (rb.Sensor(name, SHORT, values),), {})
    with pytest.raises(rb.InputError, match=naming("noise.csv log robot lifts")):
        rb.fit("pendulum_robot", [noise], ["kv"])


@pytest.mark.slow
def test_the_inertia_of_a_whole_body_is_fitted_and_stays_physical(tmp_path: Path) -> None:
    """The frame's ten numbers are fitted; the result is positive definite in any case."""
    numbers = numbers_of("pendulum_robot").with_whole(["frame"])
    paths = [path for path in numbers.known if path.startswith(WHOLE)]
    truth = {path: numbers.known[path].value for path in paths}
    wrong = {path: 1.05 * value for path, value in truth.items()}
    path = tmp_path / "wrong.toml"
    path.write_text(numbers.text(wrong, numbers.scene({})), encoding="utf-8")
    made = log(of=rb.integrate("pendulum_robot", SHORT, 1e-9))
    result = rb.fit(path, [made], ["frame.inertia"], noise=NOISE)
    assert [estimate.name for estimate in result.found] == paths
    for estimate in result.found:
        # Measured at most 0.7 deviations, from the noise of the log.
        assert abs(estimate.value - truth[estimate.name]) < 3 * estimate.deviation
    assert (
        sum(estimate.determined for estimate in result.found) >= 4
    )  # the mass and the centre of mass
    moments = np.linalg.eigvalsh(result.scene.ball.frame.inertia)
    assert 0 < moments[2] < moments[0] + moments[1]


WHOLE = ("frame.mass", "frame.centre", "frame.inertia")


def test_commands_in_a_log_are_held_and_may_be_delayed() -> None:
    """They replace the scene's commands; a delay of 0 is found to rounding."""
    times = np.linspace(0.0, 1.5, 61)
    commands = np.round(rb.load_scene("pendulum_robot").hinges[0].command.rate(times), 1)
    driven = rb.load_scene("pendulum_robot").with_hinges(
        command={"frame": held(times + 0.03, commands)}
    )
    made = replace(log(of=rb.integrate(driven, times)), commands={"frame": (times, commands)})
    result = rb.fit("pendulum_robot", [made], ["kv"], circumstances=["commands.delay"], noise=NOISE)
    (delay,) = result.of_logs
    assert abs(delay.value - 0.03) < 3 * delay.deviation  # measured 0.7 deviations
    assert delay.deviation < 0.01
    assert result.explains


def test_a_held_out_log_is_explained_by_the_fit_of_the_other() -> None:
    """For the held-out log only the initial state is fitted."""
    logs = [log(0, name="a.csv"), log(1, name="b.csv")]
    result = rb.fit("pendulum_robot", logs, ["kv"], noise=NOISE, hold_out=1)
    assert [sensor.log for sensor in result.held_out] == ["b.csv"] * 3
    assert result.explains
    assert all(sensor.probability > 1e-3 for sensor in result.held_out)


Read = Callable[[Motion], np.ndarray]
SENSED: Mapping[str, Read] = {
    "position": lambda m: m.contact_point,
    "gyro": lambda m: m.angular_velocity,
    "frame_angle": lambda m: m.hinge_angles,
    "frame_rate": lambda m: m.hinge_rates,
    "frame_torque": lambda m: m.loads.motor_torques,
}


@pytest.mark.parametrize("name", SENSED)
def test_sensors_read_the_arrays_of_the_motion(name: str) -> None:
    """To the last bit; a bias is the remaining difference."""
    m = motion()
    sensor = rb.Sensor(name, m.times, SENSED[name](m))
    assert not apart(sensor, m, np.arange(len(m.times)), {}).any()


def test_an_accelerometer_at_rest_reads_gravity_upwards() -> None:
    """A ball at rest reads +g along the vertical in frame axes."""
    still = rb.load_scene("pendulum_robot").with_hinges(command={"frame": 0.0})
    still = replace(still, start=rb.Start(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)))
    m = rb.integrate(still, np.array([0.0, 1e-3, 2e-3]))
    sensor = rb.Sensor("accelerometer", m.times[1:2], np.array([[0.0, 0.0, 9.81]]))
    # Measured 4e-3: the frame's centre of mass is off its axle, so it starts to turn.
    assert np.abs(apart(sensor, m, np.array([0, 1, 2]), {})).max() < 0.3


def test_a_shell_gyro_is_rotated_by_the_hinge_angle() -> None:
    """It measures the shell's rotation, whose axial component is independent of the angle."""
    m = motion()
    sensor = rb.Sensor("shell_gyro", m.times, np.zeros((len(m.times), 3)))
    read = -apart(sensor, m, np.arange(len(m.times)), {})
    along = m.angular_velocity[:, 1] - m.hinge_rates[:, 0]
    assert np.abs(read[:, 1] - along).max() < 1e-12  # measured 4e-15: rounding
    turning = m.angular_velocity - np.outer(m.hinge_rates[:, 0], [0.0, 1.0, 0.0])
    sizes = np.linalg.norm(read, axis=1) - np.linalg.norm(turning, axis=1)
    assert np.abs(sizes).max() < 1e-12


def test_noise_is_estimated_from_the_readings_alone() -> None:
    """Within a tenth, on a path of some metres; for rounded readings it is the rounding noise."""
    # A fast robot at 50 Hz. Measured with 20 seeds: 0.97 to 1.02 of the noise, ± 0.06.
    for sensor in log().sensors:
        assert noise_of(sensor) == pytest.approx(NOISE[sensor.name], rel=0.2)
    times = np.linspace(0.0, 10.0, 1001)
    path = np.stack([np.sin(times), 3 * np.cos(2 * times)], axis=1)
    noisy = path + np.random.default_rng(2).normal(0.0, 1e-3, path.shape)
    assert noise_of(rb.Sensor("position", times, noisy)) == pytest.approx(1e-3, rel=0.1)
    rounded = np.round(0.01 * path[:, :1], 3)
    # An encoder's resolution of 1e-3 gives 2.9e-4.
    noise = noise_of(rb.Sensor("frame_angle", times, rounded))
    assert 2.5e-4 < noise < 6e-4


LOGS = {
    "x,y\n0,0\n": "times x y",
    "t,foo\n0,1\n1,1\n": "t foo x,y,z",
    "t,qw,qx\n0,1,0\n1,1,0\n": "qw qx qy qz",
    "t,x,y\n0,0,0\n1,0,0\n": "position 2 4",
    "t,x,y\n0,0,0\n0,0,0\n": "times",
    "t,wx [foo],wy,wz\n0,0,0,0\n1,0,0,0\n": "wx 'foo' rad/s",
    "t,frame_rate [foo]\n0,0\n1,0\n": "frame_rate 'foo' rad/s",
    "t,ax [foo],ay,az\n0,0,0,0\n1,0,0,0\n": "ax 'foo' m/s²",
    "t,frame_rate,frame_command [rpm]\n0,0,0\n1,0,0\n": "frame_command 'rpm' rad/s",
    "t,x,y,frame_command\n0,0,0,\n1,0,0,\n2,0,0,\n3,1,1,\n": "frame_command values",
    "t,x,y\n0,0,0\n1,0,0\n2,0,0\n3e3,1,1\n": "4 3000~s 750~s",
}


def refusal(text: str, folder: Path) -> str:
    """Return the message with which a log with this text is refused."""
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(rb.InputError) as refused:
        rb.read_log(path, rb.load_scene("pendulum_robot"))
    return str(refused.value)


@pytest.mark.parametrize("text", LOGS)
def test_an_unusable_log_is_refused_in_a_line(text: str, tmp_path: Path) -> None:
    """The message names the file and the missing part."""
    message = refusal(text, tmp_path)
    assert "log.csv: " in message
    assert unnamed(LOGS[text], message) == []


def test_each_sensor_has_its_own_times(tmp_path: Path) -> None:
    """Empty cells are skipped; units in titles are converted to SI; commands are held."""
    rows = ["t,x [mm],y [mm],frame_angle [deg],frame_command,shell_wx [deg/s],shell_wy,shell_wz"]
    rows += [
        f"{i / 10},{i if i % 2 else ''},{i if i % 2 else ''},{9 * i},{i},{9 * i},0,0"
        for i in range(10)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    run_log = rb.read_log(path, rb.load_scene("pendulum_robot"))
    position, gyro, angle = run_log.sensors
    assert position.times.tolist() == [0.1, 0.3, 0.5, 0.7, 0.9]
    assert position.values[0].tolist() == [1e-3, 1e-3]
    assert angle.values[2, 0] == gyro.values[2, 0] == pytest.approx(np.radians(18.0))
    assert run_log.commands["frame"][1].tolist() == list(range(10))
    notes = ["x y mm", "shell_wx deg/s", "frame_angle deg"]
    assert untold(notes, run_log.notes) == []


NAMES = {
    "kv": "frame.kv",
    "battery.mass": "frame.part.battery.mass",
    "rolling": "friction.rolling",
    "battery.centre.z": "frame.part.battery.centre.z",
}


@pytest.mark.parametrize("name", NAMES)
def test_the_last_words_of_a_path_suffice(name: str) -> None:
    """If they match a single path."""
    assert numbers_of("pendulum_robot").path_of(name) == NAMES[name]


@pytest.mark.parametrize(
    ("free", "facts"),
    [
        (["mass"], "'mass' frame.part.plate.mass frame.part.motor.mass"),
        (["frame.kw"], "'frame.kw' frame.kv"),
        (["kv=1:2"], "frame.kv 0.4 1:2"),
        (["kv=0:1"], "kv=0:1 servo gain 0~N~m~s/rad"),
        (["kv=a"], "frame.kv=0.1:0.8"),
        (["kv", "frame.kv"], "frame.kv twice"),
        ([], "free"),
        (["rotor1.inertia"], "inertia 'rotor1' frame"),
        (["frame.inertia", "frame.mass"], "frame.mass twice"),
    ],
)
def test_names_that_cannot_be_freed_are_refused(free: list[str], facts: str) -> None:
    """Ambiguous and unknown names, with near matches; limits beside the value; an empty list."""
    with pytest.raises(rb.InputError) as refused:
        rb.fit("pendulum_robot", [log()], free, noise=NOISE)
    assert unnamed(facts, str(refused.value)) == []


def test_the_noise_of_an_unknown_sensor_is_refused() -> None:
    """With near matches."""
    with pytest.raises(rb.InputError, match=naming("sensor 'gyros' gyro")):
        rb.fit("pendulum_robot", [log()], ["kv"], noise={"gyros": 0.1})


def test_a_circumstance_of_an_unknown_sensor_is_refused() -> None:
    """The message lists the possible ones."""
    with pytest.raises(rb.InputError, match=naming("circumstance")):
        rb.fit("pendulum_robot", [log()], ["kv"], circumstances=["frame_angle.zero"])


def test_numbers_that_no_body_can_have_are_refused_with_their_key() -> None:
    """The limits of a scene file's keys hold for the numbers of a fit too."""
    numbers = numbers_of(PROJECT / "examples" / "my_robot.toml")
    with pytest.raises(rb.InputError, match=naming("frame.part1.mass positive -1~kg")):
        numbers.scene({"frame.part.1.mass": -1.0})


def test_every_catalog_scene_is_rebuilt_from_its_numbers() -> None:
    """To the last bit."""
    for name in rb.catalog():
        if name in ("fig12", "pendulum_robot", "swinging_frame", "wobbling_drive"):
            assert numbers_of(name).scene({}).ball == rb.load_scene(name).ball


CAROM = """title = "Carom ball"
rolling = "classical"
duration = 8.4
[shell]
radius = 0.03275
mass = 0.23
inertia = { axial = 9.868e-5, transverse = 9.868e-5 }
[frame]
mass = 1e-6
inertia = [1e-12, 1e-12, 1e-12]
[friction]
rolling = 1e-3
[start]
attitude = [1, 0, 0, 0]
angular_velocity = [0, 10.63, 0]
"""


def carom(folder: Path, changes: Mapping[str, str] = MappingProxyType({})) -> tuple[Path, Path]:
    """Write a scene of a billiard ball, and its track in mm: 0.348 t - 0.04255 t²/2 along 3.0 rad.

    The speed and the deceleration belong to a rolling friction of 0.19886 mm.
    """
    text, t = CAROM, np.arange(0.0, 8.0, 0.16)
    for old, new in changes.items():
        text = text.replace(old, new)
    way = (0.348 * t - 0.04255 * t**2 / 2)[:, None] * [np.cos(3.0), np.sin(3.0)]
    table = np.column_stack([t, np.round(way + np.array([0.8, -0.26]), 3)])
    np.savetxt(folder / "track.csv", table, delimiter=",", header="t,x,y", comments="")
    (folder / "carom.toml").write_text(text, encoding="utf-8")
    return folder / "carom.toml", folder / "track.csv"


@pytest.mark.parametrize(
    "changes",
    [
        {"10.63": "53"},
        {"rolling = 1e-3": "rolling = 4e-5", "10.63": "-2"},
        {"rolling = 1e-3": "rolling = 0", "10.63": "0"},
    ],
    ids=str,
)
@pytest.mark.parametrize("circumstances", [(), ("world.yaw", "world.origin")])
def test_a_track_gives_the_first_speed_heading_and_resistance(
    changes: Mapping[str, str], circumstances: tuple[str, ...], tmp_path: Path
) -> None:
    """Speeds 5 times off either way and at rest; rolling friction 5 times off either way, and 0."""
    scene, track = carom(tmp_path, changes)
    result = rb.fit(scene, track, ["friction.rolling"], circumstances=circumstances)
    assert result.explains
    # Measured 3e-5, from rounding to mm.
    assert result.found[0].value == pytest.approx(1.9886e-4, rel=3e-4)
    began = {number.name.rpartition(": ")[2]: number.began for number in result.of_logs}
    if circumstances:
        # The scene begins along X, or backwards, or at rest. Measured 7e-4 off.
        heading = np.angle(np.exp(3.0j) * (-1 if "-2" in changes.values() else 1))
        assert began["world.yaw"] == pytest.approx(
            heading if changes.get("10.63") != "0" else 0.0, abs=3e-3
        )
        assert began["world.origin.x"] == pytest.approx(0.8, abs=1e-3)


def with_load(**law: float) -> Callable[[rb.Scene], rb.Log]:
    """Return a function that gives the log of a robot with a load on its hinge."""
    load = rb.Actuator("load", (("frame", 1.0),), rb.Law(0.0, 0.0, 0.0)._replace(**law))
    return lambda s: log(of=rb.integrate(replace(s, actuators=(load,)), LONG, 1e-9))


def late(s: rb.Scene, names: tuple[str, ...]) -> rb.Log:
    """Return a log in which some sensors' clocks are 0.05 s late."""
    made = log(of=rb.integrate(s, LONG, 1e-9))
    sensors = [
        replace(sensor, times=sensor.times + 0.05) if sensor.name in names else sensor
        for sensor in made.sensors
    ]
    return replace(made, sensors=tuple(sensors))


LONG = rb.sample_times(3.0, 1 / 30)
REASONS: Mapping[str, tuple[Callable[[rb.Scene], rb.Log], str]] = {
    "resistance": (
        lambda s: log(of=rb.integrate(replace(s, friction=Friction(rolling=3e-4)), LONG, 1e-9)),
        "friction.rolling --free χ²/n",
    ),
    "stiction": (with_load(friction=0.02), "stiction frame N~m"),
    "damping": (with_load(per_rate=0.05), "damping frame N~m~s/rad"),
    "rest position": (with_load(at_rest=0.05), "frame zero torque 0.05~N~m"),
    "gyro late": (lambda s: late(s, ("gyro",)), "gyro.clock s --also"),
    "all late": (lambda s: late(s, tuple(NOISE)), "sensors.clock s --also"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", REASONS)
def test_the_most_probable_reason_of_a_wrong_model_is_named(case: str) -> None:
    """With its amount and what to free; without it χ²/n is 1.04 to 11."""
    made, facts = REASONS[case]
    robot = rb.load_scene("pendulum_robot")
    result = rb.fit(robot, made(robot), ["kv"], noise=NOISE)
    assert not result.explains
    assert unnamed(facts, result.reason) == []


def test_the_motion_of_a_plane_that_keeps_still_may_be_fitted(tmp_path: Path) -> None:
    """Its equations have one number more, so they are not integrated together with the others."""
    scene, track = carom(tmp_path, {"rolling = 1e-3": "rolling = 1.9886e-4"})
    (found,) = rb.fit(scene, track, ["plane.motion.x"]).found
    assert abs(found.value) < 3 * found.deviation  # measured 0.3: the noise of the log


@pytest.mark.slow
def test_a_missing_resistance_and_strange_positions_are_reasons(tmp_path: Path) -> None:
    """A fit that explains its log has none. Positions along a zigzag fit no ball."""
    scene, track = carom(tmp_path, {"rolling = 1e-3": "rolling = 0"})
    assert rb.fit(scene, track, ["friction.rolling"]).reason == ""
    facts = "resistance friction.rolling --free χ²/n"
    assert unnamed(facts, rb.fit(scene, track, ["shell.mass"]).reason) == []
    made = rb.read_log(track, scene)
    (position,) = made.sensors
    zigzag = position.values + 0.02 * np.sin(9 * position.times)[:, None]
    wrong = replace(made, sensors=(replace(position, values=zigzag),))
    reason = rb.fit(scene, wrong, ["friction.rolling"], noise={"position": 1e-3}).reason
    assert unnamed("position unit --also world.origin,world.yaw", reason) == []


def test_the_order_of_the_quaternion_is_a_reason() -> None:
    """A log without a gyro, whose quaternions are in the order x, y, z, w."""
    position, attitude, _ = log(of=rb.integrate("pendulum_robot", SHORT)).sensors
    wrong = replace(attitude, values=np.roll(attitude.values, -1, axis=1))
    made = rb.Log("run.csv", (position, wrong), {})
    reason = rb.fit(
        "pendulum_robot", made, ["battery.mass"], noise={"position": 1e-3, "attitude": 1e-2}
    ).reason
    assert unnamed("quaternion's~order x,~y,~z,~w --map", reason) == []


@pytest.mark.parametrize("patience", [0.0, 5.0])
def test_a_fit_out_of_time_says_what_is_still_moving(
    patience: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At once, and after 5 motions: each takes a second on the clock of this test."""
    scene, track = carom(tmp_path, {"10.63": "0"})
    clock = count()
    monkeypatch.setattr(time, "monotonic", lambda: float(next(clock)))
    result = rb.fit(scene, track, ["friction.rolling"], patience=patience)
    assert not result.complete
    (moving, *_) = result.moving
    assert unnamed("friction.rolling moving", moving) == []
    # Measured 2.10e-4, the value that the track gives, of 1.99e-4.
    best = 1e-3 if patience == 0.0 else 1.99e-4
    assert result.found[0].value == pytest.approx(best, rel=0.1)
