"""Logs as people have them: clocks, names, units and formats."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.files.columns import read_table
from robotball.motion import Motion
from robotball.rotations import Array
from tests.messages import naming, unnamed, untold

SCENE = rb.load_scene("pendulum_robot")
MOTION = rb.integrate(SCENE, rb.sample_times(0.4))
STEADY = rb.load_scene("pendulum_robot").with_hinges(command={"frame": 2.0})


def log_of(
    folder: Path,
    titles: str,
    *columns: Array,
    scene: rb.Scene = SCENE,
    names: Mapping[str, str] | None = None,
) -> rb.Log:
    """Write columns to a CSV file and return its log; names: as in `read_log`."""
    path = folder / "log.csv"
    np.savetxt(path, np.column_stack(columns), "%.17g", ",", header=titles, comments="")
    return rb.read_log(path, scene, names)


CLOCKS = {
    "ms since the start": (1e3, 0.0, "ms"),
    "ms since boot": (1e3, 4321.5, "ms 4321.5~s"),
    "µs since boot": (1e6, 4321.5, "us 4321.5~s"),
    "ns since boot": (1e9, 4321.5, "ns 4321.5~s"),
    "s since boot": (1.0, 4321.5, "4321.5~s"),
    "Unix time in s": (1.0, 1.7e9, "1700000000~s"),
    "Unix time in ms": (1e3, 1.7e9, "ms 1700000000~s"),
    "Unix time in µs": (1e6, 1.7e9, "us 1700000000~s"),
    "Unix time in ns": (1e9, 1.7e9, "ns 1700000000~s"),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_times_of_any_clock_count_from_the_first_row(clock: str, tmp_path: Path) -> None:
    """The unit follows from the size, and a note names it. 2e-7 s is a bit of Unix time in s."""
    scale, begin, facts = CLOCKS[clock]
    times = (MOTION.times + begin) * scale
    times = times if scale == 1.0 else np.round(times)
    log = log_of(tmp_path, "timestamp,x,y", times, MOTION.contact_point)
    assert log.sensors[0].times == pytest.approx(MOTION.times, abs=5e-7)
    assert unnamed(facts, " ".join(log.notes)) == []


def test_slow_times_in_s_are_not_taken_for_ticks(tmp_path: Path) -> None:
    """Whole seconds, and a log that begins while a scene with changing rates runs."""
    t = np.arange(3.0, 13.0)
    log = log_of(tmp_path, "t,x,y", t, np.column_stack([0.1 * t, 0.0 * t]))
    assert (log.sensors[0].times.tolist(), log.notes) == (t.tolist(), ())
    log = log_of(tmp_path, "t,x,y", t, np.column_stack([0.1 * t, 0.0 * t]), scene=STEADY)
    assert log.sensors[0].times.tolist() == (t - 3.0).tolist()


def angles(m: Motion) -> Array:
    """Return roll, pitch and yaw (n, 3) by the formulas for rotations about X, Y and then Z."""
    w, x, y, z = m.attitude.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.column_stack([roll, np.arcsin(2 * (w * y - z * x)), yaw])


def test_roll_pitch_and_yaw_are_an_attitude(tmp_path: Path) -> None:
    """In rad, in degrees by the title, and in degrees by the size of the pitch."""
    m = rb.integrate("fig12", rb.sample_times(2.0))
    for titles, factor, facts in (
        ("t,roll,pitch,yaw", 1.0, "rad"),
        ("t,roll [deg],pitch [deg],yaw [deg]", 180 / np.pi, "deg"),
        ("t,euler.roll,euler.pitch,euler.yaw", 180 / np.pi, "deg pitch π/2"),
    ):
        log = log_of(tmp_path, titles, m.times, factor * angles(m), scene=rb.load_scene("fig12"))
        off = np.abs(np.abs((log.sensors[0].values * m.attitude).sum(axis=1)) - 1)
        assert off.max() < 1e-12  # measured 7e-16, rounding
        assert unnamed(facts, " ".join(log.notes)) == []


def test_a_log_without_known_times_names_the_map_of_its_first_column(tmp_path: Path) -> None:
    """As it can be copied into the command."""
    with pytest.raises(rb.InputError, match=naming("zeit --map~'zeit=t~[ms]'")):
        log_of(tmp_path, "zeit,x,y", MOTION.times, MOTION.contact_point)


def test_the_order_of_numbered_quaternion_columns_is_noted(tmp_path: Path) -> None:
    """The numbers do not tell whether w is the first or the last."""
    columns = MOTION.times, MOTION.attitude
    log = log_of(tmp_path, "t,quat_0,quat_1,quat_2,quat_3", *columns)
    assert untold(["quat_0,~quat_1,~quat_2,~quat_3 qw,~qx,~qy,~qz"], log.notes) == []
    assert log_of(tmp_path, "t,qw,qx,qy,qz", *columns).notes == ()


def test_units_are_found_or_asked_for_by_size(tmp_path: Path) -> None:
    """Accelerations in g are converted; raw counts and large rates are refused."""
    still = np.tile([0.01, 0.02, 1.0], (len(MOTION.times), 1))
    log = log_of(tmp_path, "t,accel_x,accel_y,accel_z", MOTION.times, still)
    assert log.sensors[0].values[0] == pytest.approx(9.80665 * still[0], rel=1e-15)
    assert untold(["ax ay az g"], log.notes) == []
    counts = np.round(MOTION.angular_velocity * 180 / np.pi * 131.0)
    titles, largest = "t,gyro_x,gyro_y,gyro_z", np.abs(counts).max()
    with pytest.raises(rb.InputError) as refused:
        log_of(tmp_path, titles, MOTION.times, counts)
    axis = "xyz"[int(np.abs(counts).max(axis=0).argmax())]
    facts = f"log.csv gyro_{axis} {largest:g} 70~rad/s counts --map [deg/s]"
    assert unnamed(facts, str(refused.value)) == []
    size = f"[{1 / 131.0:.8f} deg/s]"
    names = {f"gyro_{axis}": f"w{axis} {size}" for axis in "xyz"}
    log = log_of(tmp_path, titles, MOTION.times, counts, names=names)
    # Rounding to a count is 7e-5 rad/s.
    assert log.sensors[0].values == pytest.approx(MOTION.angular_velocity, abs=1e-4)


def json_lines(folder: Path) -> Path:
    """Write a motion as an IMU and a JointState at a third of its times."""
    path, lines = folder / "log.jsonl", []
    for i, t in enumerate(MOTION.times):
        sec, nanosec = divmod(round(t * 1e9) + 1_700_000_000_999_000_000, 1_000_000_000)
        q, w = MOTION.attitude[i], MOTION.angular_velocity[i]
        imu = {
            "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "base"},
            "orientation": dict(zip("wxyz", q, strict=True)),
            "angular_velocity": dict(zip("xyz", w, strict=True)),
            "covariance": [0.0] * 9,
        }
        state = {"name": ["roll_joint"], "position": [MOTION.hinge_angles[i, 0]], "velocity": []}
        lines.append(json.dumps(imu if i % 3 else {**imu, "joint_states": state}))
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def mat(folder: Path) -> Path:
    """Write a motion as a MATLAB structure with a remark and a parameter."""
    savemat = pytest.importorskip("scipy.io").savemat
    orientation, gyro = MOTION.attitude, MOTION.angular_velocity
    log = {"time": MOTION.times, "orientation": orientation, "gyro": gyro, "note": "second run"}
    log["roll_joint"] = {
        "position": np.where(np.arange(len(gyro)) % 3, np.nan, MOTION.hinge_angles[:, 0])
    }
    savemat(folder / "log.mat", {"log": log, "radius": 0.1})
    return folder / "log.mat"


def bag(folder: Path, storage: str) -> Path:
    """Write a motion as topics of a ROS bag."""
    writers = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = ("Imu", "JointState"), ("Quaternion", "Vector3")
    Imu, JointState = (store.types[f"sensor_msgs/msg/{name}"] for name in kinds[0])
    Quaternion, Vector = (store.types[f"geometry_msgs/msg/{name}"] for name in kinds[1])
    Header, Time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    plugin = writers.StoragePlugin[storage]
    with writers.Writer(folder / storage, version=9, storage_plugin=plugin) as writer:
        topics = [
            writer.add_connection(topic, kind.__msgtype__, typestore=store)
            for topic, kind in (("/imu/data", Imu), ("/joint_states", JointState))
        ]
        none = np.zeros(9)
        for i, t in enumerate(MOTION.times):
            stamp = round(t * 1e9) + 1_700_000_000_999_000_000
            header = Header(Time(*divmod(stamp, 1_000_000_000)), "base")
            w, x, y, z = MOTION.attitude[i]
            rates, force = Vector(*MOTION.angular_velocity[i]), Vector(0.0, 0.0, 9.81)
            imu = Imu(header, Quaternion(x, y, z, w), none, rates, none, force, none)
            messages = [imu]
            if i % 3 == 0:
                angle, empty = MOTION.hinge_angles[i], np.zeros(0)
                messages.append(JointState(header, ["roll_joint"], angle, empty, empty))
            for topic, message in zip(topics, messages, strict=False):
                data = store.serialize_cdr(message, message.__msgtype__)
                writer.write(topic, stamp + 123, data)
    (path,) = (folder / storage).glob(f"*.{'db3' if storage == 'SQLITE3' else 'mcap'}")
    return path


FORMATS: dict[str, Callable[[Path], Path]] = {
    "JSON lines": json_lines,
    "MATLAB": mat,
    "MCAP": lambda folder: bag(folder, "MCAP"),
    "SQLite": lambda folder: bag(folder, "SQLITE3"),
}


@pytest.mark.parametrize("kind", FORMATS)
def test_logs_of_other_formats_have_the_same_sensors(kind: str, tmp_path: Path) -> None:
    """Times within 3e-7 s, a bit of Unix time; the hinge has a third of the readings."""
    path = FORMATS[kind](tmp_path)
    log = rb.read_log(path, SCENE, {"roll_joint.position": "frame_angle"})
    sensors = {sensor.name: sensor for sensor in log.sensors}
    assert sensors["gyro"].times == pytest.approx(MOTION.times, abs=1e-6)
    assert np.array_equal(sensors["gyro"].values, MOTION.angular_velocity)
    assert np.abs(sensors["attitude"].values - MOTION.attitude).max() < 1e-15
    assert np.array_equal(sensors["frame_angle"].values, MOTION.hinge_angles[::3])


def test_a_column_is_chosen_by_name_if_two_mean_the_same(tmp_path: Path) -> None:
    """A whole title precedes the end of another; of two ends, --map chooses one."""
    columns = MOTION.times, MOTION.contact_point, 0 * MOTION.contact_point
    log = log_of(tmp_path, "t,x,y,goal/pose.position.x,goal/pose.position.y", *columns)
    assert np.array_equal(log.sensors[0].values, MOTION.contact_point)
    titles = "t,odom/pose.position.x,odom/pose.position.y,goal/pose.position.x,goal/pose.position.y"
    with pytest.raises(
        rb.InputError, match=naming("odom/pose.position.x goal/pose.position.x --map")
    ):
        log_of(tmp_path, titles, *columns)
    names = {f"odom/pose.position.{axis}": axis for axis in "xy"}
    log = log_of(tmp_path, titles, *columns, names=names)
    assert np.array_equal(log.sensors[0].values, MOTION.contact_point)
    with pytest.raises(rb.InputError, match=naming("'odo' t odom/pose.position.x")):
        log_of(tmp_path, titles, *columns, names={"odo": "x"})
    with pytest.raises(rb.InputError, match=naming("'frame_angel' frame_angle")):
        log_of(tmp_path, titles, *columns, names={"t": "frame_angel"})


DAMAGED = {
    "a.jsonl": ('{"t": 0}\n{"t": ', "line~2 JSON"),
    "b.jsonl": ('"t"\n', "numbers"),
    "c.mat": ("MATLAB 5.0", "MAT"),
    "d.bag": ("#ROSBAG V2.0", "BAG"),
    "e.db3": ("SQLite format 3", "DB3"),
    "f.mcap": ("MCAP0", "MCAP"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_of_another_format_is_refused_in_a_line(name: str, tmp_path: Path) -> None:
    """With the name of the file."""
    text, facts = DAMAGED[name]
    if name[0] in "def":
        pytest.importorskip("rosbags")
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(rb.InputError) as refused:
        read_table(tmp_path / name)
    assert str(refused.value).startswith(str(tmp_path / name))
    assert unnamed(facts, str(refused.value)) == []
    assert "\n" not in str(refused.value)
