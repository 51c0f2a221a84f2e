"""Changes to a robot file: its text compiles to the same robot with just these changes."""

from pathlib import Path
from tempfile import TemporaryDirectory
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robotball.errors import InputError
from robotball.rotations import Array
from robotball.user_model.mended_file import Change, Editable, StartShift, compiled, editable
from robotball.user_model.robot_file import RobotFile, open_robot
from tests.messages import naming

FIRST = Path("examples/first_robot.xml")
STILL, UP = np.zeros(3), np.array([0.01, -0.02, 0.03])
PAIR = {"condim": "3", "friction": "1 1 0.005 0.0001 0.0001"}
CHANGES = [
    Change("step", "it is ---- <long>", option={"timestep": ".0005", "integrator": "RK4"}),
    Change("friction", "it slips", pair={"friction": "20 20 .005 .0001 .0001"}),
    Change("contacts", "they touch", exclude=(("ball", "pendulum"),)),
]
START = Change("start", "it hangs in the air", start=True)


def editable_of(path: Path, shift: Array = STILL) -> Editable:
    robot = open_robot(path)
    return editable(robot, StartShift(shift, STILL, None), PAIR, range(1, robot.model.nbody))


ENDS = (
    "</mujoco>\n",
    "  </mujoco>",
    "<!-- -->\n</mujoco>",
    "</mujoco >",
    "</mujoco>\n<!-- </mujoco> -->\n",
)


@pytest.mark.parametrize("end", ENDS)
def test_changes_set_their_values_and_nothing_else(tmp_path: Path, end: str) -> None:
    """For any end of the file; a reason with "--" cannot close the comment that it is in."""
    path = tmp_path / "mine.xml"
    path.write_text(FIRST.read_text().rstrip().removesuffix("</mujoco>") + end)
    before = mujoco.MjModel.from_xml_path(str(path))
    ours = editable_of(path)
    text = ours.changed(CHANGES)
    model = compiled(text)
    assert (model.opt.timestep, model.opt.integrator) == (5e-4, mujoco.mjtIntegrator.mjINT_RK4)
    assert (model.npair, model.nexclude) == (1, before.nexclude + 1)
    assert model.pair_friction[0].tolist() == [20, 20, 0.005, 1e-4, 1e-4]
    assert model.pair_dim[0] == 3
    assert {model.geom(int(i)).name for i in (model.pair_geom1[0], model.pair_geom2[0])} == {
        ours.sphere,
        ours.plane,
    }
    assert np.array_equal(model.body_mass, before.body_mass)
    assert np.array_equal(model.qpos0, before.qpos0)
    # A second change overrides the first.
    again = tmp_path / "again.xml"
    again.write_text(text)
    (step, *_) = CHANGES
    twice = compiled(editable_of(again).changed([Change("step", "", option={"timestep": ".01"})]))
    assert (twice.opt.timestep, twice.npair) == (0.01, 1)
    assert step.words not in text


# Any character allowed in XML except controls; troublesome ones more often.
NAMES = st.text(
    st.sampled_from("\"'&<>-]= /{%")
    | st.characters(codec="utf-8", exclude_categories=["Cc"], exclude_characters="\ufffe\uffff"),
    min_size=1,
    max_size=12,
)
NAMED = """<mujoco model={0}><worldbody><geom name={1} type="plane" size="1 1 .1"/>
<body name={2} pos="0 0 1"><freejoint/><geom name={3} size=".2" mass="1"/><body name={4}>
<joint name={5} axis="0 1 0"/><geom name={6} size=".05" mass="1"/></body></body></worldbody>
<contact><pair name={7} geom1={1} geom2={3}/></contact>
<actuator><motor name={8} joint={5}/></actuator></mujoco>"""


@settings(deadline=None, max_examples=50)
@given(st.lists(NAMES, min_size=9, max_size=9, unique=True))
@example(['"', "'", "&quot;", "a\"'b", "--><mujoco/>", "pos='0 0 0'", "</mujoco>", " ", "é\u202e"])
@example(["plane", "rolling_sphere", "body1", "body2", "a", "b", "c", "d", "e"])
def test_every_name_survives_a_change(names: list[str]) -> None:
    """In a file that gets another start, an exclude and a pair."""
    text = NAMED.format(*map(quoteattr, names))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "named.xml"
        path.write_text(text, encoding="utf-8")
        spec = mujoco.MjSpec.from_string(text)
        robot = RobotFile(path, spec, spec.compile(), sphere=1, plane=0, notes=())
        ours = editable(robot, StartShift(UP, STILL, None), PAIR, (1, 2))
        exclude = Change("contacts", names[4], exclude=((names[2], names[4]),))
        model = compiled(ours.changed([*CHANGES[:2], START, exclude]))
    kept = [model.geom(0), model.body(1), model.geom(1), model.body(2), model.joint(1)]
    kept += [model.geom(2), model.actuator(0)]
    assert [element.name for element in kept] == [*names[1:7], names[8]]
    assert (model.npair, model.nexclude) == (1, 1)


def test_unnamed_parts_get_unique_names(tmp_path: Path) -> None:
    """The usual names of sphere, plane and body are taken by other elements."""
    path = tmp_path / "unnamed.xml"
    path.write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 1"><freejoint/>'
        '<geom size=".2" mass="1"/><geom name="plane" size=".1"/><geom name="rolling_sphere" '
        'size=".1"/><body name="body1"/></body></worldbody></mujoco>'
    )
    ours = editable_of(path)
    model = compiled(ours.changed([Change("apart", "", exclude=(("body1_", "body1"),))]))
    assert {ours.sphere, ours.plane} == {"rolling_sphere_", "plane_"}
    assert (model.body(1).name, model.nexclude) == ("body1_", 1)


def test_a_start_is_shifted_in_bodies_and_keyframes(tmp_path: Path) -> None:
    """Only if a change requests it; without changes the text of the file is kept."""
    ours = editable_of(FIRST, UP)
    before = compiled(ours.source)
    moved, still = compiled(ours.changed([START])), compiled(ours.changed(CHANGES))
    assert moved.qpos0[:3] - before.qpos0[:3] == pytest.approx(UP, abs=1e-12)
    assert np.array_equal(still.qpos0, before.qpos0)
    assert moved.nkey == before.nkey
    for old, new in zip(before.key_qpos, moved.key_qpos, strict=True):
        assert new[:3] - old[:3] == pytest.approx(UP, abs=1e-12)
        assert np.array_equal(new[3:], old[3:])
    assert ours.changed([]) == ours.text


def test_a_keyframe_of_an_included_file_is_shifted(tmp_path: Path) -> None:
    """MuJoCo writes the text; position and velocity of the keyframe change."""
    (tmp_path / "ball.xml").write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="ball" pos="0 0 1">'
        '<freejoint/><geom size=".2" mass="1"/></body></worldbody><keyframe>'
        '<key qpos="0 0 1 1 0 0 0" qvel="1 0 0 0 0 0"/></keyframe></mujoco>'
    )
    path = tmp_path / "mine.xml"
    path.write_text('<mujoco><include file="ball.xml"/></mujoco>')
    ours = editable(open_robot(path), StartShift(UP, 2 * UP, 0), PAIR, [])
    moved = compiled(ours.changed([START]))
    assert moved.key_qpos[0, :3] - [0, 0, 1] == pytest.approx(UP, abs=1e-12)
    assert moved.key_qvel[0, :3] - [1, 0, 0] == pytest.approx(2 * UP, abs=1e-12)


def test_a_file_with_hyphens_in_a_comment_can_be_changed(tmp_path: Path) -> None:
    """Two in a row are not XML. MuJoCo reads and writes them all the same."""
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><!-- a -- b --><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 .2">'
        '<freejoint/><geom size=".2" mass="1"/></body></worldbody></mujoco>'
    )
    option = {"integrator": "RK4"}
    model = compiled(editable_of(path).changed([Change("integrator", "", option=option)]))
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4.value


def test_a_text_that_does_not_compile_is_refused() -> None:
    """The error contains the message of MuJoCo."""
    with pytest.raises(InputError, match=naming("nosuch")):
        compiled("<mujoco><worldbody><geom type='nosuch'/></worldbody></mujoco>")
