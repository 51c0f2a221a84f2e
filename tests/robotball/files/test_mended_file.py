"""Changes to a robot's file: as text that compiles to the same robot with just these changes."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robotball.errors import InputError
from robotball.files.mended_file import Change, Editable, Moves, compiled, editable
from robotball.files.robot_file import open_robot
from robotball.rotations import Array

FIRST = Path("examples/first_robot.xml")
STILL, UP = np.zeros(3), np.array([0.01, -0.02, 0.03])
PAIR = {"condim": "3", "friction": "1 1 0.005 0.0001 0.0001"}
CHANGES = [
    Change("step", "it is -- <long>", option={"timestep": ".0005", "integrator": "RK4"}),
    Change("friction", "it slips", pair={"friction": "20 20 .005 .0001 .0001"}),
    Change("contacts", "they touch", exclude=(("ball", "pendulum"),)),
]
START = Change("start", "it hangs in the air", start=True)


def editable_of(path: Path, shift: Array = STILL) -> Editable:
    robot = open_robot(path)
    return editable(robot, Moves(shift, STILL, None), PAIR, range(1, robot.model.nbody))


@pytest.mark.parametrize("end", ["</mujoco>\n", "  </mujoco>", "<!-- -->\n</mujoco>"])
def test_changes_are_what_they_set_and_nothing_else(tmp_path: Path, end: str) -> None:
    """However the file ends; a pair in it is given way to, and words cannot close a comment."""
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
        ours.sphere, ours.plane,
    }  # fmt: skip
    assert np.array_equal(model.body_mass, before.body_mass)
    assert np.array_equal(model.qpos0, before.qpos0)
    # Twice changed it is still the same, as what is given last counts.
    again = tmp_path / "again.xml"
    again.write_text(text)
    (step, *_) = CHANGES
    twice = compiled(editable_of(again).changed([Change("step", "", option={"timestep": ".01"})]))
    assert (twice.opt.timestep, twice.npair) == (0.01, 1)
    assert step.words not in text


def test_a_start_is_moved_in_bodies_and_keyframes(tmp_path: Path) -> None:
    """By the shift, where it is asked for alone; without a change the text is the file's own."""
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


def test_a_keyframe_of_a_file_that_is_included_is_moved(tmp_path: Path) -> None:
    """Its text is written by MuJoCo, with the place and the velocity at the keyframe changed."""
    (tmp_path / "ball.xml").write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="ball" pos="0 0 1">'
        '<freejoint/><geom size=".2" mass="1"/></body></worldbody><keyframe>'
        '<key qpos="0 0 1 1 0 0 0" qvel="1 0 0 0 0 0"/></keyframe></mujoco>'
    )
    path = tmp_path / "mine.xml"
    path.write_text('<mujoco><include file="ball.xml"/></mujoco>')
    ours = editable(open_robot(path), Moves(UP, 2 * UP, 0), PAIR, [])
    moved = compiled(ours.changed([START]))
    assert moved.key_qpos[0, :3] - [0, 0, 1] == pytest.approx(UP, abs=1e-12)
    assert moved.key_qvel[0, :3] - [1, 0, 0] == pytest.approx(2 * UP, abs=1e-12)


def test_a_text_that_does_not_compile_is_refused() -> None:
    """With MuJoCo's own words."""
    with pytest.raises(InputError, match=r"the changed file does not compile: .*nosuch"):
        compiled("<mujoco><worldbody><geom type='nosuch'/></worldbody></mujoco>")
