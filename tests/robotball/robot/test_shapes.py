"""A user's robot is drawn as it is built: its own geoms and meshes, where its model has them."""

from base64 import b64decode
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.robot.looks import looks_of
from robotball.robot.shapes import Shape
from robotball.rotations import Array
from robotball.user_model.robot_file import open_robot
from robotball.view import render, web
from robotball.view.render import Film, frames
from robotball.view.stage import build_stage, pose
from robotball.view.tracks import track_of
from tests.messages import untold
from tests.robotball.scene_files.scene_texts import PLATE
from tests.robotball.user_model.test_robot_file import GIMBAL, HULL

# A wheel that is a mesh, in a housing, both in a hull that is a mesh; the sphere is not looked at.
CORNERS = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
MESHED = f"""<mujoco><asset><mesh name="wheel" vertex="{CORNERS} 2 0 0" scale=".02 .03 .01"/>
<mesh name="hull" builtin="sphere" params="3" scale=".149 .149 .149"/>
<material name="green" rgba="0 1 0 1"/></asset>
<worldbody><geom type="plane" size="5 5 .1"/>
<body name="ball" pos="0 0 .15"><freejoint/><geom type="sphere" size=".15" mass=".6" group="3"/>
 <geom type="mesh" mesh="hull" mass="0" contype="0" conaffinity="0"/>
 <body name="plate"><joint name="axle" axis="0 1 0"/>
  <geom type="ellipsoid" size=".06 .05 .004" pos="0 0 .03" mass=".8" contype="0" conaffinity="0"/>
  <geom type="box" size=".06 .05 .04" pos="0 0 -.05" mass=".1" contype="0" conaffinity="0"/>
  <body name="wheel" pos="0 0 -.05" euler="0 10 20"><joint name="spin" axis="0 0 1"/>
   <geom type="mesh" mesh="wheel" mass=".4" contype="0" conaffinity="0" material="green"/></body>
 </body></body></worldbody>
<keyframe><key qpos="0 0 .15 1 .1 0 0 .1 0" qvel="0 0 0 0 0 0 0 9"/></keyframe></mujoco>"""
# The joint of the user's model that a link's angle is of.
JOINTS = {
    "plate.xml": (PLATE, {"plate": "axle", "wheel": "spin"}),
    "gimbal.xml": (GIMBAL, {"gimbal_g1": "g2", "inner": "g1", "slider": "s"}),
    "meshed.xml": (MESHED, {"plate": "axle", "wheel": "spin"}),
}
TIMES = np.linspace(0.0, 0.6, 13)
FIG12 = rb.integrate(rb.load_scene("fig12"), TIMES)


def scene_of(folder: Path, name: str, text: str) -> rb.Scene:
    (folder / name).write_text(text)
    return rb.load_scene(str(folder / name))


@cache
def motion_of(name: str) -> tuple[rb.Motion, Any]:
    """A motion of a user's robot, and the model of its own file."""
    with TemporaryDirectory() as folder:
        scene = scene_of(Path(folder), name, JOINTS[name][0])
        return rb.integrate(scene, TIMES), open_robot(Path(folder) / name)


def points_of(model: Any, data: Any, i: int) -> Array:
    """The vertices of a mesh, or the ends of the axes of another geom, (n, 3), world."""
    own: Array = np.vstack([np.zeros(3), np.diag(model.geom_size[i])])
    if (mesh := model.geom_dataid[i]) >= 0:
        own = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    return np.asarray(own @ data.geom_xmat[i].reshape(3, 3).T + data.geom_xpos[i])


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.filterwarnings("ignore::robotball.errors.SceneWarning")
def test_a_geom_of_a_users_is_where_its_own_model_has_it(name: str) -> None:
    """At four times of a motion, seen from the sphere; measured 4e-10 of the radius, a mesh 3e-8.

    The nine digits of the stage's MJCF dominate, and a mesh's 32 bits. With the joints' angles of
    the other sign it is 0.3 off at least.
    """
    joints, (motion, robot) = JOINTS[name][1], motion_of(name)
    scene = motion.scene
    stage, track = build_stage(looks_of(scene.ball), ["#0072B2"], [1.0]).compile(), track_of(motion)
    drawn, own = mujoco.MjData(stage), mujoco.MjData(robot.model)
    shown = [i for i in range(stage.ngeom) if "#" in stage.mat(stage.geom_matid[i]).name]
    users = [i for i in range(robot.model.ngeom) if i not in (robot.plane, robot.sphere)]
    assert len(shown) == len(users)
    off = {1: 0.0, -1: 0.0}
    for k in (0, 4, 8, 12):
        stands = track.stands(track.sampled[k : k + 1])
        pose(stage, drawn, stands, [stands])
        (turn,), (shift,) = stands["shell"]
        places = [points_of(stage, drawn, i) for i in shown]
        for sign in off:
            for link, angle in zip(scene.ball.links, motion.hinge_angles[k], strict=True):
                own.joint(joints[link.name]).qpos[0] = sign * angle
            mujoco.mj_kinematics(robot.model, own)
            to_sphere = own.geom_xmat[robot.sphere].reshape(3, 3)
            for i in users:
                seen = (points_of(robot.model, own, i) - own.geom_xpos[robot.sphere]) @ to_sphere
                wanted = seen / scene.ball.radius @ turn.T + shift
                # Of all that is drawn, as the bodies stand in another order.
                alike = [each for each in places if len(each) == len(wanted)]
                off[sign] = max(off[sign], min(float(np.abs(wanted - at).max()) for at in alike))
    assert off[1] < (1e-7 if name == "meshed.xml" else 1.5e-9)
    assert off[-1] > 0.1


def test_what_hides_the_inside_is_drawn_through(tmp_path: Path) -> None:
    """A hull, and a housing where the wheel is wholly inside; the plate beside it is not."""
    looks = looks_of(motion_of("meshed.xml")[0].scene.ball)
    assert [each.material for each in looks["shell"] if each.kind == "mesh"] == ["#80808026"]
    assert [each.material for each in looks["plate"]] == ["#808080ff", "#80808026"]
    assert [each.material for each in looks["wheel"]] == ["#00ff00ff"]
    beside = scene_of(tmp_path, "beside.xml", MESHED.replace('"wheel" pos="0', '"wheel" pos=".1'))
    assert [each.material for each in looks_of(beside.ball)["plate"]][1] == "#808080ff"


@pytest.mark.filterwarnings("ignore::robotball.errors.SceneWarning")
def test_a_body_without_a_shape_is_the_box_of_its_inertia(tmp_path: Path) -> None:
    """A URDF's chassis without visuals, in a colour that is seen through; no bearings, no hoop."""
    looks = looks_of(scene_of(tmp_path, "hull.urdf", HULL).ball)
    (box, arm) = looks["chassis"]
    assert (box.kind, arm.kind) == ("box", "capsule")
    assert box.pos * 0.15 == pytest.approx([0.03, 0.0, -0.04])
    assert {each.kind for each in looks["shell"]} == {"sphere", "torus"}


def test_a_page_has_the_triangles_of_a_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of them, at their places; of a mesh too large its corners, near each other, are one."""
    motion, robot = motion_of("meshed.xml")

    def hull() -> Array:
        (shape,) = [
            each
            for body in web.view_data([motion])["bodies"]
            for each in body["shapes"]
            if each["kind"] == "mesh" and body["name"] == "shell"
        ]
        vertices, faces = (np.frombuffer(b64decode(each), "<f4") for each in shape["mesh"])
        return vertices.reshape(-1, 3)[faces.astype(int).reshape(-1, 3)] * shape["size"]

    whole = hull()
    assert len(whole) == robot.model.mesh("hull").facenum[0] > 500
    assert np.linalg.norm(whole, axis=2) == pytest.approx(0.149 / 0.15, rel=1e-4)
    monkeypatch.setattr(web, "_MESHES", 400)
    thin = hull()
    assert 100 < len(thin) <= 200
    # Measured 0.92: the sphere of fewer corners lies inside the other.
    assert np.linalg.det(thin).sum() / np.linalg.det(whole).sum() == pytest.approx(0.92, abs=0.05)


@pytest.mark.usefixtures("screen")
def test_a_film_of_a_users_robot_shows_its_mesh_and_says_nothing_of_rotors(tmp_path: Path) -> None:
    """The wheel's green on 0.1 % of the picture, and none where it is grey.

    It turns by 0.3 rad a frame, of which a rotor would have no marks left.
    """
    film, greens = Film(size=(240, 480)), []
    green, grey = motion_of("meshed.xml")[0], MESHED.replace("0 1 0 1", ".5 .5 .5 1")
    # The motion is that of the green wheel, whose colour weighs nothing.
    for scene in (green.scene, scene_of(tmp_path, "grey.xml", grey)):
        theory = replace(green, scene=scene)
        picture = next(frames([theory, theory], film)).astype(int)
        greens.append((picture[..., 1] - picture[..., [0, 2]].max(axis=2) > 60).mean())
        assert [*render._notes([theory], film, looks_of(theory.scene.ball))] == []
    assert greens[0] > 5e-4
    assert greens[1] == 0
    notes = [*render._notes([FIG12], film, looks_of(FIG12.scene.ball))]
    assert untold(["rotors marks"], notes) == []


@pytest.mark.parametrize(
    ("kind", "sizes", "volume"),
    [
        ("box", (0.1, 0.2, 0.3), 0.048),
        ("cylinder", (0.5, 0.25, 0.0), np.pi * 0.125),
        ("torus", (0.5, 0.1, 0.0), 2 * np.pi**2 * 0.5 * 0.01),
    ],
)
def test_the_triangles_of_a_body_close_it(
    kind: Any, sizes: tuple[float, ...], volume: float
) -> None:
    """Their volume by the divergence theorem, and so each seen from outside anticlockwise.

    A round bar of 48 sides lacks 0.3 % of it, a tube of 8 sides 10 %.
    """
    turn, pos = np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 2.0, 3.0])
    corners = Shape(kind, np.array(sizes), pos, turn, "frame").triangles
    assert 0.89 * volume < np.linalg.det(corners).sum() / 6 < volume * (1 + 1e-12)
