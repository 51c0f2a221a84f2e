"""Motions are restored to the last bit; foreign trajectories are understood or refused."""

import io
import sys
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.files import columns as table_file
from robotball.files.columns import read_table
from robotball.files.trajectories import Trajectory, read_trajectory
from robotball.motion import arrays_of
from tests.messages import naming, unnamed, untold
from tests.robotball.scene_files.scene_texts import scene_of

FIG12 = rb.load_scene("fig12")
KINDS = ("csv", "npz", "parquet")
NAMES = "t,x,y,qw,qx,qy,qz"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["chaplygin_ball", "three_rotors"])
def test_a_motion_is_restored_to_the_last_bit(name: str, kind: str, tmp_path: Path) -> None:
    """Every array of the motion and its loads, and the engine's label, also with a single hinge.

    Including the least and the largest number, minus zero, and the NaN and inf of a diverged run.
    """
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    motion = rb.integrate(rb.load_scene(name), np.linspace(0, 0.1, 7))
    odd = np.array([5e-324, -0.0, 1.7976931348623157e308, 0.1, np.nan, np.inf, 1 / 3])
    motion = replace(motion, momentum=np.stack([odd, odd[::-1], odd], axis=1))
    motion.save(tmp_path / f"m.{kind}")
    again = rb.load_motion(tmp_path / f"m.{kind}", motion.scene)
    for (place, array), (_, back) in zip(arrays_of(motion), arrays_of(again), strict=True):
        assert array.tobytes() == np.ascontiguousarray(back).tobytes(), place
        assert array.shape == back.shape
    assert again.engine == motion.engine


def test_the_header_has_the_scene_the_engine_and_the_units(tmp_path: Path) -> None:
    """The scene's TOML restores the scene, so a motion needs no other file.

    A contact engine's timestep allows several files to show the order of convergence.
    """
    motion = rb.simulate(FIG12, np.linspace(0, 0.1, 5), settings="balanced")
    motion.save(tmp_path / "m.csv")
    table = read_table(tmp_path / "m.csv")
    assert scene_of(table.header["scene_toml"]) == replace(FIG12, name="mine")
    assert list(table.columns)[:7] == NAMES.split(",")
    assert tuple(table.units[name] for name in ("x", "wx", "Mx")) == ("m", "rad/s", "kg m²/s")
    assert '"name": "MuJoCo"' in table.header["engine"]
    assert float(table.header["timestep"]) == motion.report.timestep
    with pytest.warns(rb.SceneWarning, match=naming("fig12 fig13")):
        rb.load_motion(tmp_path / "m.csv", rb.load_scene("fig13"))
    with (
        pytest.warns(rb.SceneWarning),
        pytest.raises(rb.InputError, match=naming("rotor2_angle rotor3_angle")),
    ):
        rb.load_motion(tmp_path / "m.csv", rb.load_scene("three_rotors"))


def test_a_motion_is_saved_only_in_known_formats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without pyarrow the error names the extra and the other formats; no file is left."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    motion = rb.integrate(FIG12, np.linspace(0, 1, 5))
    with pytest.raises(rb.InputError, match=naming("parquet .csv .npz")):
        motion.save(tmp_path / "m.parquet")
    with pytest.raises(rb.InputError, match=naming(".csv .npz .parquet '.xlsx'")):
        motion.save(tmp_path / "m.xlsx")
    assert list(tmp_path.iterdir()) == []


ROWS = "0,0,0,1,0,0,0\n0.5,1,2,0.6,0.8,0,0\n1,3,4,0,0,1,0\n"
PLAIN = f"{NAMES}\n{ROWS}"


def read(tmp_path: Path, text: str | bytes, name: str = "run.csv") -> Trajectory:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_trajectory(path)


def assert_is_the_plain_one(trajectory: Trajectory) -> None:
    assert trajectory.times.tolist() == [0, 0.5, 1]
    assert trajectory.position[:, :2].tolist() == [[0, 0], [1, 2], [3, 4]]
    assert trajectory.attitude.tolist() == [[1, 0, 0, 0], [0.6, 0.8, 0, 0], [0, 0, 1, 0]]


# Names of positions and quaternions in simulators, before x, y, z and w; the last is ROS.
PLACES = ("p", "pos_", "position.", "contact_", "pose.position.")
TURNS = ("quat_", "quaternion.", "orientation_", "rot_", "pose.orientation.")
SAME = {
    "plain": PLAIN,
    "semicolons and decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "tabs": PLAIN.replace(",", "\t"),
    "spaces": PLAIN.replace(",", "  "),
    "line ends of another system": PLAIN.replace("\n", "\r\n"),
    "comments and empty lines": f"# from my engine\n\n% v3\n{PLAIN}\n",
    "names in a comment": f"# t x y qw qx qy qz\n{ROWS.replace(',', ' ')}",
    "quoted names": PLAIN.replace("t,x,y,qw", '"t","x","y","qw"'),
    "a line of units": PLAIN.replace("\n", "\ns,m,m,-,-,-,-\n", 1),
    "other names": PLAIN.replace(NAMES, "Time (s),pos_x,pos_y,q_w,q_x,q_y,q_z"),
    **{
        place: PLAIN.replace(NAMES, f"time,{place}x,{place}y,{turn}w,{turn}x,{turn}y,{turn}z")
        for place, turn in zip(PLACES, TURNS, strict=True)
    },
    "a mark of UTF-8": "\ufeff" + PLAIN,
}


@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
def test_other_notations_are_read_the_same(tmp_path: Path, text: str) -> None:
    """Delimiters, line ends, comments, names, a byte order mark."""
    trajectory = read(tmp_path, text, "run.txt")
    assert_is_the_plain_one(trajectory)
    assert trajectory.notes == ()


def test_columns_may_have_any_order_and_others_among_them(tmp_path: Path) -> None:
    """Unknown columns keep their names."""
    rows = "0,5,1,0,0,0,0,0,1,2\n0,6,0.6,2,0.5,0,1,0.8,1,2\n0,7,0,4,1,1,3,0,1,2\n"
    trajectory = read(tmp_path, f"qz,energy,qw,y,t,qy,x,qx,z,x_error\n{rows}")
    assert_is_the_plain_one(trajectory)
    assert trajectory.position[:, 2].tolist() == [1, 1, 1]
    assert trajectory.others is not None
    others = {name: column.tolist() for name, column in trajectory.others.items()}
    assert others == {"energy": [5, 6, 7], "x_error": [2, 2, 2]}


@pytest.mark.parametrize(
    "text",
    [
        PLAIN.replace("t,x,y", "t [ms],x [mm],y [mm]"),
        PLAIN.replace("t,x,y", "t_ms,x_mm,y_mm"),
        PLAIN.replace("\n", "\nms,mm,mm,-,-,-,-\n", 1),
        f"# units: t ms, x mm, y mm\n{PLAIN}",
        f'# units: {{"t": "ms", "x": "mm", "y": "mm"}}\n{PLAIN}',
    ],
)
def test_units_in_the_file_are_applied_and_noted(tmp_path: Path, text: str) -> None:
    """From a column's title, a line below it, or a comment."""
    trajectory = read(tmp_path, text)
    assert trajectory.times.tolist() == [0, 0.0005, 0.001]
    assert trajectory.position[2, :2].tolist() == [0.003, 0.004]
    assert untold(["t ms", "x y mm"], trajectory.notes) == []


TIME = {"sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
LENGTH = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254}
RATE = {"rpm": np.pi / 30, "rev/s": 2 * np.pi, "deg/s": np.pi / 180, "°/s": np.pi / 180}
SIZES = {
    ("t",): TIME,
    ("x", "y", "z"): LENGTH | {"ft": 0.3048},
    ("wx", "wy", "wz"): RATE | {"1/s": 1.0, "rad/s": 1.0},
}


@pytest.mark.parametrize(
    ("names", "unit", "si"), [(n, u, si) for n, sizes in SIZES.items() for u, si in sizes.items()]
)
def test_each_unit_is_converted_correctly(
    tmp_path: Path, names: list[str], unit: str, si: float
) -> None:
    """Seconds, metres and rad/s in all their columns; other columns are unchanged."""
    units = ", ".join(f"{name} {unit}" for name in names)
    rows = "".join(f"{t},{t},{t},{t},1,0,0,0,{t},{t},{t}\n" for t in (0, 3))
    trajectory = read(tmp_path, f"t,x,y,z,qw,qx,qy,qz,wx,wy,wz\n# units: {units}\n{rows}")
    assert trajectory.angular_velocity is not None
    values = [trajectory.times[1], *trajectory.position[1], *trajectory.angular_velocity[1]]
    expected = [3 * si if name in names else 3 for name in ("t", "x", "y", "z", "wx", "wy", "wz")]
    assert values == pytest.approx(expected, rel=1e-15)


def test_arrays_of_an_npz_are_split_into_columns(tmp_path: Path) -> None:
    """Positions (n, 3) and quaternions (n, 4); a simulator's other data is skipped."""
    plain = read(tmp_path, PLAIN)
    omega = np.arange(9.0).reshape(3, 3)
    np.savez(
        tmp_path / "a.npz",
        time=plain.times,
        position=np.nan_to_num(plain.position),
        quat=plain.attitude,
        omega=omega,
        momentum=-omega,
        names=np.array(["my", "own", "engine"]),
        frames=np.zeros((3, 2, 2)),
    )
    trajectory = read_trajectory(tmp_path / "a.npz")
    assert_is_the_plain_one(trajectory)
    np.testing.assert_array_equal([trajectory.angular_velocity], [omega])
    np.testing.assert_array_equal([trajectory.momentum], [-omega])
    assert trajectory.others == {}
    np.savez(tmp_path / "b.npz", time=plain.times, x=plain.times[1:])
    with pytest.raises(rb.InputError, match=naming("columns lengths")):
        read_trajectory(tmp_path / "b.npz")


def test_a_long_file_is_read_in_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With comments and faults in any chunk; the memory peak is a few times the numbers.

    Measured 2.8 times with five chunks, 9.9 times with one, which holds all numbers as Python
    floats.
    """
    monkeypatch.setattr(table_file, "_CHUNK", 2_000)
    rows = [f"{i},1.5,2.5,1,0,0,0\n" for i in range(10_000)]
    rows[7_000] = "# halfway\n" + rows[7_000]
    path = tmp_path / "run.csv"
    path.write_text(f"{NAMES}\n{''.join(rows)}")
    tracemalloc.start()
    try:
        columns = read_table(path).columns
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert columns["t"].tolist() == list(range(10_000))
    assert peak < 5 * sum(column.nbytes for column in columns.values())
    rows[9_000] = "9000,one,2.5,1,0,0,0\n"
    with pytest.raises(rb.InputError, match=naming("line~9003 x 'one'")):
        read(tmp_path, f"{NAMES}\n{''.join(rows)}")


DEEP = "[" * 100_000 + "]" * 100_000


def zipped(packing: int = zipfile.ZIP_STORED, **members: bytes) -> bytes:
    """Return an NPZ with these members."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", packing) as file:
        for name, data in members.items():
            file.writestr(f"{name}.npy", data)
    return whole.getvalue()


def member(descr: str, shape: object) -> bytes:
    """Return the header of an array without its data."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


def saved(text: str) -> bytes:
    """Return an array of one text as NumPy saves it."""
    whole = io.BytesIO()
    np.save(whole, np.array(text))
    return whole.getvalue()


# By the reason that the reader gives.
NPZS = {
    "recursion~depth": zipped(units=saved(DEEP)),
    "recursion": zipped(header=saved('{"a": ' + DEEP + "}")),
    "EOF multi-line": zipped(x=member("(((", 1).replace(b"}", b" ")),
    "int large": zipped(x=member("'<f8'", (2**200,))),
    "unsupported": zipped(zipfile.ZIP_LZMA, x=bytes(4000)).replace(b"\x5d\0\0", b"\xff\0\0"),
}
REFUSED = {
    "": "numbers",
    f"{NAMES}\n": "rows",
    ROWS: f"columns {NAMES}",
    PLAIN.replace("x,y", "x,b"): "y missing t x b",
    PLAIN.replace("qw,qx", "a,b"): "qw,~qx,~qy,~qz qy,~qz",
    PLAIN.replace("1,2,", "nan,2,"): "x nan row~2 0.5~s",
    PLAIN.replace("1,2,", "inf,2,").replace("3,4", "inf,4"): "x inf row~2 1~more",
    PLAIN.replace("0.5,", "nan,"): "t nan row~2",
    PLAIN.replace("1,2,", "1e300,2,"): "x 1e+300 row~2 1e+50",
    PLAIN.replace("0.5,", "1e300,"): "t 1e+300 row~2 1e+50",
    f"# units: {DEEP}\n{PLAIN}": "CSV recursion",
    PLAIN.replace("0.5,", "1.5,"): "1~s row~3 1.5~s",
    PLAIN.replace("0.5,", "1,"): "1~s 2 3",
    PLAIN.replace("0,0,0,1", "-1,0,0,1"): "0~s -1~s",
    PLAIN.replace("1,2,", ",2,"): "line~3 x empty",
    PLAIN.replace("1,2,", "one,2,"): "line~3 x 'one'",
    PLAIN.replace("1,2,", "2,"): "line~3 6 7",
    PLAIN.replace("0.6,0.8", "0.6,0.83"): "quaternion row~2 1.02416",
    PLAIN.replace("0.6,0.8", "0,0"): "quaternion row~2 0",
    PLAIN.replace("x,y", "x [furlong],y"): "x 'furlong' m km cm",
    PLAIN.replace("x,y", "x,x"): "'x' two",
    PLAIN.replace("x,y", "x,pos_x"): "'x' 'pos_x'",
    "t,x,y,qw,qx,qy,qz,wx\n0,0,0,1,0,0,0,1\n1,0,0,1,0,0,0,1\n": "wx wy wz",
    f"{NAMES}\n0,0,0,1,0,0,0\n": "1~row two",
}
NO_TABLES = [
    ("a.csv", b"\x93NUMPY\xff\xfe", "UTF-8"),
    *(("a.npz", data, "NPZ") for data in (b"PK\x03\x04 no zip", b"t,x,y", b"\x93NUMPY\x01\x00")),
    *(("a.npz", data, f"NPZ {why}") for why, data in NPZS.items()),
    ("a.xlsx", b"", ".csv .tsv .txt .npz .parquet '.xlsx'"),
    *(("run.csv", text.encode(), facts) for text, facts in REFUSED.items()),
]


def refusal(name: str, data: bytes, folder: Path) -> str:
    """Return the message with which a file of these bytes is refused."""
    with pytest.raises(rb.InputError) as refused:
        read(folder, data, name)
    return str(refused.value)


@pytest.mark.parametrize(("name", "data", "facts"), NO_TABLES, ids=[row[2] for row in NO_TABLES])
def test_an_invalid_file_is_refused_in_one_line(
    tmp_path: Path, name: str, data: bytes, facts: str
) -> None:
    """For any bytes: with the file's name, the row and the fault."""
    message = refusal(name, data, tmp_path)
    assert unnamed(facts, message) == []
    assert f"{name}: " in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("written", "off"), [("0.6,0.8000001", None), ("0.6,0.8000025", "2e-06"), ("0.6,0.815", "0.01")]
)
def test_rounded_quaternions_are_normalized_and_noted(
    tmp_path: Path, written: str, off: str | None
) -> None:
    """Two digits are off by a hundredth; single precision gives no note."""
    trajectory = read(tmp_path, PLAIN.replace("0.6,0.8", written))
    assert np.linalg.norm(trajectory.attitude, axis=1).tolist() == pytest.approx([1, 1, 1], 1e-15)
    assert untold([f"quaternions {off}"] if off else [], trajectory.notes) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path: Path, kind: str) -> None:
    """100 times, bytes are changed, lost, doubled or inserted; no other error is raised."""
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    rng = np.random.default_rng(3)
    whole, damaged = tmp_path / f"whole.{kind}", tmp_path / f"damaged.{kind}"
    rb.integrate(FIG12, np.linspace(0, 1, 6)).save(whole)
    refused = []
    for _ in range(100):
        data = bytearray(whole.read_bytes())
        for _ in range(rng.integers(1, 6)):
            i, j = sorted(rng.integers(0, len(data), 2).tolist())
            data[i] = rng.integers(256)
            if rng.random() < 0.3:
                del data[i : min(j, i + 40)]
            elif rng.random() < 0.3:
                data[i:i] = data[j : j + 100]
        damaged.write_bytes(bytes(data))
        try:
            read_trajectory(damaged)
        except rb.InputError as error:
            refused.append(str(error))
    assert not [line for line in refused if "\n" in line]
    assert len(refused) > 60  # measured 82 to 99


def test_a_dataset_of_xarray_has_every_array_with_its_dimensions_and_units() -> None:
    """Including the arrays of the report of a contact engine; values are equal by name."""
    pytest.importorskip("xarray")
    motion = rb.simulate("fig12", 0.1, settings="fast")
    dataset = motion.to_xarray()
    arrays = {place[-1]: array for place, array in arrays_of(motion)}
    assert {"time", *dataset.data_vars} == {"time", *arrays} - {"times"}
    for name, array in dataset.data_vars.items():
        assert (array.values == arrays[name]).all()
        assert array.dims[0] == "time"
        assert array.attrs["units"]
    assert (dataset.time.values == motion.times).all()
    assert dataset.momentum.dims == ("time", "world")
    assert dataset.angular_velocity.dims == ("time", "frame")
    assert dataset.hinge_rates.sel(hinge="rotor1").units == "rad/s"
    assert (dataset.attrs["scene"], dataset.attrs["engine"]) == ("fig12", "MuJoCo")


def test_without_xarray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(rb.InputError, match=naming("to_xarray xarray")):
        rb.integrate(FIG12, 0.1).to_xarray()
