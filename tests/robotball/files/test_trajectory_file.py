"""Trajectories from other simulators: read as they are meant, or refused in one line."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.files.columns import read_table
from robotball.files.trajectories import Trajectory, read_trajectory

ROWS = """0,0,0,1,0,0,0
0.5,1,2,0.6,0.8,0,0
1,3,4,0,0,1,0
"""
PLAIN = f"t,x,y,qw,qx,qy,qz\n{ROWS}"


def read(tmp_path: Path, text: str | bytes, name: str = "run.csv") -> Trajectory:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_trajectory(path)


def assert_is_the_plain_one(trajectory: Trajectory) -> None:
    assert trajectory.times.tolist() == [0, 0.5, 1]
    assert trajectory.position[:, :2].tolist() == [[0, 0], [1, 2], [3, 4]]
    assert trajectory.attitude.tolist() == [[1, 0, 0, 0], [0.6, 0.8, 0, 0], [0, 0, 1, 0]]


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
    "other names": PLAIN.replace("t,x,y,qw,qx,qy,qz", "Time (s),pos_x,pos_y,q_w,q_x,q_y,q_z"),
    "names of a ROS bag": PLAIN.replace(
        "t,x,y,qw,qx,qy,qz",
        "time,pose.position.x,pose.position.y,pose.orientation.w,pose.orientation.x,"
        "pose.orientation.y,pose.orientation.z",
    ),
}


@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
def test_what_is_written_in_another_way_is_read_the_same(tmp_path: Path, text: str) -> None:
    """Delimiters, line ends, comments, names."""
    assert_is_the_plain_one(read(tmp_path, text))


def test_columns_may_stand_in_any_order_with_others_among_them(tmp_path: Path) -> None:
    """What is not known is kept by its own name."""
    rows = "0,5,1,0,0,0,0,0,1\n0,6,0.6,2,0.5,0,1,0.8,1\n0,7,0,4,1,1,3,0,1\n"
    text = f"qz,energy,qw,y,t,qy,x,qx,z\n{rows}"
    trajectory = read(tmp_path, text)
    assert_is_the_plain_one(trajectory)
    assert trajectory.position[:, 2].tolist() == [1, 1, 1]
    assert trajectory.others is not None
    assert trajectory.others["energy"].tolist() == [5, 6, 7]


@pytest.mark.parametrize(
    ("encoding", "name"), [("utf-8-sig", "a.csv"), ("utf-16", "a.csv"), ("utf-8-sig", "a.txt")]
)
def test_a_byte_order_mark_is_skipped_and_told(tmp_path: Path, encoding: str, name: str) -> None:
    """One line says so."""
    trajectory = read(tmp_path, PLAIN.encode(encoding), name)
    assert_is_the_plain_one(trajectory)
    assert trajectory.notes == ("it begins with a byte order mark, which is skipped",)


@pytest.mark.parametrize(
    "text",
    [
        PLAIN.replace("t,x,y", "t [ms],x [mm],y [mm]"),
        PLAIN.replace("t,x,y", "t_ms,x_mm,y_mm"),
        PLAIN.replace("\n", "\nms,mm,mm,-,-,-,-\n", 1),
        f"# units: t ms, x mm, y mm\n{PLAIN}",
    ],
)
def test_units_that_the_file_names_are_taken_and_told(tmp_path: Path, text: str) -> None:
    """By the title of a column, a line below it, or a comment."""
    trajectory = read(tmp_path, text)
    assert trajectory.times.tolist() == [0, 0.0005, 0.001]
    assert trajectory.position[2, :2].tolist() == [0.003, 0.004]
    assert trajectory.notes == (
        "t: in ms, as the file says, and taken so",
        "x, y: in mm, as the file says, and taken so",
    )


@pytest.mark.parametrize(
    ("column", "unit", "written", "si"),
    [
        *(("t", unit, 1.0, si) for unit, si in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))),
        ("t", "min", 1.0, 60.0),
        *(("x", unit, 1.0, si) for unit, si in (("km", 1e3), ("cm", 1e-2), ("mm", 1e-3))),
        *(("x", unit, 1.0, si) for unit, si in (("um", 1e-6), ("in", 0.0254), ("ft", 0.3048))),
        *(
            ("wx", unit, half, np.pi)
            for unit, half in (("deg/s", 180), ("rpm", 30), ("rev/s", 0.5))
        ),
    ],
)
def test_each_unit_has_its_size(
    tmp_path: Path, column: str, unit: str, written: float, si: float
) -> None:
    """A unit of time or length in seconds or metres, half a turn a second in rad/s."""
    names = f"t,x,y,qw,qx,qy,qz,wx,wy,wz\n# units: {column} {unit}\n"
    trajectory = read(
        tmp_path, names + "".join(f"{t},{t},0,1,0,0,0,{t},0,0\n" for t in (0, written))
    )
    assert trajectory.angular_velocity is not None
    columns = {"t": trajectory.times, "x": trajectory.position[:, 0]}
    assert columns.get(column, trajectory.angular_velocity[:, 0])[1] == pytest.approx(si, rel=1e-15)


def test_arrays_of_an_npz_may_be_whole(tmp_path: Path) -> None:
    """Positions (n, 3) and quaternions (n, 4), and what a simulator keeps beside them."""
    plain = read(tmp_path, PLAIN)
    np.savez(
        tmp_path / "a.npz",
        time=plain.times,
        position=np.nan_to_num(plain.position),
        quat=plain.attitude,
        omega=np.ones((3, 3)),
        name=np.array("my engine"),
    )
    trajectory = read_trajectory(tmp_path / "a.npz")
    assert_is_the_plain_one(trajectory)
    assert trajectory.angular_velocity is not None


def test_a_long_file_is_read_in_pieces(tmp_path: Path) -> None:
    """Comments and faults in any piece; the peak of memory is a few times the numbers alone.

    Measured 2.7 times, in three pieces; 10.5 where all lines are kept, and all numbers as Python's.
    """
    rows = [f"{i},1.5,2.5,1,0,0,0\n" for i in range(50_000)]
    rows[35_000] = "# halfway\n" + rows[35_000]
    path = tmp_path / "run.csv"
    path.write_text("t,x,y,qw,qx,qy,qz\n" + "".join(rows))
    tracemalloc.start()
    try:
        columns = read_table(path).columns
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert columns["t"].tolist() == list(range(50_000))
    assert peak < 5 * sum(column.nbytes for column in columns.values())
    rows[45_000] = "45000,one,2.5,1,0,0,0\n"
    with pytest.raises(rb.InputError, match="line 45003: x is 'one', and must be a number"):
        read(tmp_path, "t,x,y,qw,qx,qy,qz\n" + "".join(rows))


REFUSED = {
    "": "the file holds no numbers",
    "t,x,y,qw,qx,qy,qz\n": "no rows of numbers",
    ROWS: "no line with the columns' names, as t,x,y,qw,qx,qy,qz",
    PLAIN.replace("qw,qx", "a,b"): "columns qw,qx are missing; there are t, x, y, a, b, qy, qz",
    PLAIN.replace("1,2,", "nan,2,"): r"x is nan in row 2 \(t = 0.5 s\); it must be finite",
    PLAIN.replace("1,2,", "inf,2,").replace("3,4", "inf,4"): r"x is inf in row 2 .*, and in 1 more",
    PLAIN.replace("0.5,", "nan,"): "t is nan in row 2; it must be finite",
    PLAIN.replace("0.5,", "1.5,"): "times must increase: t = 1 s in row 3 follows 1.5 s",
    PLAIN.replace("0.5,", "1,"): "t = 1 s comes twice, in rows 2 and 3",
    PLAIN.replace("0,0,0,1", "-1,0,0,1"): "times must start at 0 s or later, not at -1 s",
    PLAIN.replace("1,2,", ",2,"): "line 3: x is empty, and must be a number",
    PLAIN.replace("1,2,", "one,2,"): "line 3: x is 'one', and must be a number",
    PLAIN.replace("1,2,", "2,"): "line 3 has 6 values, and there are 7 columns",
    PLAIN.replace("0.6,0.8", "0.6,1.8"): "quaternion in row 2 .* has length 1.89737, and must",
    PLAIN.replace("0.6,0.8", "0,0"): "quaternion in row 2 .* has length 0",
    PLAIN.replace("x,y", "x [furlong],y"): "x is in 'furlong'; it can be in m, km, cm",
    PLAIN.replace("x,y", "x,x"): "two columns are called 'x'",
    PLAIN.replace("x,y", "x,pos_x"): "'x' and 'pos_x' are both the column x",
    PLAIN.replace("t,x,y", "t,x,wx"): "columns y are missing",
    "t,x,y,qw,qx,qy,qz,wx\n0,0,0,1,0,0,0,1\n1,0,0,1,0,0,0,1\n": "of wx, wy, wz there is only wx",
    "t,x,y,qw,qx,qy,qz\n0,0,0,1,0,0,0\n": "it has 1 row of numbers, and at least two are needed",
}
NO_TABLES = [
    ("a.csv", b"\x93NUMPY\xff\xfe", "it is no text in UTF-8 or UTF-16"),
    *(
        ("a.npz", data, "it is no NPZ file that can be read")
        for data in (b"PK\x03\x04 no zip", b"t,x,y", b"\x93NUMPY\x01\x00")
    ),
    ("a.bag", b"", r"one of \.csv, \.tsv, \.txt, \.npz, \.parquet, not '\.bag'"),
    *(("run.csv", text.encode(), words) for text, words in REFUSED.items()),
]


@pytest.mark.parametrize(("name", "data", "words"), NO_TABLES, ids=[each[2] for each in NO_TABLES])
def test_a_file_that_cannot_be_judged_is_one_line(
    tmp_path: Path, name: str, data: bytes, words: str
) -> None:
    """Whatever its bytes are: the file's name, the row and what is wrong in it."""
    with pytest.raises(rb.InputError, match=words) as error:
        read(tmp_path, data, name)
    assert f"{name}: " in str(error.value)
    assert "\n" not in str(error.value)


def test_quaternions_that_are_rounded_are_made_unit_and_told(tmp_path: Path) -> None:
    """Three digits are off by a thousandth."""
    trajectory = read(tmp_path, PLAIN.replace("0.6,0.8", "0.599,0.801"))
    assert np.linalg.norm(trajectory.attitude, axis=1).tolist() == pytest.approx([1, 1, 1], 1e-15)
    assert trajectory.notes == ("quaternions are off length 1 by up to 0.0002; they are made so",)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_a_damaged_file_is_one_line_or_is_read(tmp_path: Path, suffix: str) -> None:
    """Bytes changed, lost, doubled and put in anywhere, 300 times: no other error than the line."""
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    rng = np.random.default_rng(3)
    whole, damaged = tmp_path / f"whole{suffix}", tmp_path / f"damaged{suffix}"
    rb.integrate(rb.load_scene("fig12"), np.linspace(0, 1, 6)).save(whole)
    refused = []
    for _ in range(300):
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
    assert len(refused) > 200  # measured 248 to 296
