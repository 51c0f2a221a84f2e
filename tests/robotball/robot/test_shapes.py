"""A user's robot is drawn with its geoms and meshes at their places."""

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

# A mesh wheel in a housing, in a mesh hull; the colliding sphere is hidden (group 3).
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
# Joint of the user's model for each link.
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
    """Return a motion of a user's robot, and the model of its file."""
    with TemporaryDirectory() as folder:
        scene = scene_of(Path(folder), name, JOINTS[name][0])
        return rb.integrate(scene, TIMES), open_robot(Path(folder) / name)


def points_of(model: Any, data: Any, i: int) -> Array:
    """Return the vertices of a mesh, or the axis ends of another geom, (n, 3), world."""
    points: Array = np.vstack([np.zeros(3), np.diag(model.geom_size[i])])
    if (mesh := model.geom_dataid[i]) >= 0:
        points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    return np.asarray(points @ data.geom_xmat[i].reshape(3, 3).T + data.geom_xpos[i])


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.filterwarnings("ignore::robotball.errors.SceneWarning")
def test_geoms_are_drawn_where_the_users_model_has_them(name: str) -> None:
    """At four times of a motion, relative to the sphere.

    Measured 4e-10 of the radius, from the nine digits of the stage's MJCF, and 3e-8 for meshes,
    which have 32 bits. Joint angles of the wrong sign give at least 0.3.
    """
    joints, (motion, robot) = JOINTS[name][1], motion_of(name)
    scene = motion.scene
    stage, track = build_stage(looks_of(scene.ball), ["#0072B2"], [1.0]).compile(), track_of(motion)
    drawn, users_data = mujoco.MjData(stage), mujoco.MjData(robot.model)
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
                users_data.joint(joints[link.name]).qpos[0] = sign * angle
            mujoco.mj_kinematics(robot.model, users_data)
            to_sphere = users_data.geom_xmat[robot.sphere].reshape(3, 3)
            for i in users:
                from_centre = points_of(robot.model, users_data, i)
                from_centre = from_centre - users_data.geom_xpos[robot.sphere]
                expected = from_centre @ to_sphere / scene.ball.radius @ turn.T + shift
                # The stage has another order of bodies: compare with the nearest geom.
                alike = [points for points in places if len(points) == len(expected)]
                gaps = [float(np.abs(expected - points).max()) for points in alike]
                off[sign] = max(off[sign], min(gaps))
    assert off[1] < (1e-7 if name == "meshed.xml" else 1.5e-9)
    assert off[-1] > 0.1


def test_geoms_that_hide_others_are_drawn_translucent(tmp_path: Path) -> None:
    """The hull, and the housing if the wheel is entirely inside it; not the plate beside it."""
    looks = looks_of(motion_of("meshed.xml")[0].scene.ball)
    assert [shape.material for shape in looks["shell"] if shape.kind == "mesh"] == ["#80808026"]
    assert [shape.material for shape in looks["plate"]] == ["#808080ff", "#80808026"]
    assert [shape.material for shape in looks["wheel"]] == ["#00ff00ff"]
    beside = scene_of(tmp_path, "beside.xml", MESHED.replace('"wheel" pos="0', '"wheel" pos=".1'))
    assert [shape.material for shape in looks_of(beside.ball)["plate"]][1] == "#808080ff"


@pytest.mark.filterwarnings("ignore::robotball.errors.SceneWarning")
def test_a_body_without_a_shape_is_the_box_of_its_inertia(tmp_path: Path) -> None:
    """The chassis of a URDF without visuals is translucent; no bearings or hoop are drawn."""
    looks = looks_of(scene_of(tmp_path, "hull.urdf", HULL).ball)
    (box, arm) = looks["chassis"]
    assert (box.kind, arm.kind) == ("box", "capsule")
    assert box.pos * 0.15 == pytest.approx([0.03, 0.0, -0.04])
    assert {shape.kind for shape in looks["shell"]} == {"sphere", "torus"}


def test_a_page_has_the_triangles_of_a_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """All triangles, at their places; nearby vertices of a large mesh are merged."""
    motion, robot = motion_of("meshed.xml")

    def hull() -> Array:
        (shape,) = [
            shape
            for body in web.view_data([motion])["bodies"]
            for shape in body["shapes"]
            if shape["kind"] == "mesh" and body["name"] == "shell"
        ]
        vertices, faces = (np.frombuffer(b64decode(data), "<f4") for data in shape["mesh"])
        return vertices.reshape(-1, 3)[faces.astype(int).reshape(-1, 3)] * shape["size"]

    whole = hull()
    assert len(whole) == robot.model.mesh("hull").facenum[0] > 500
    assert np.linalg.norm(whole, axis=2) == pytest.approx(0.149 / 0.15, rel=1e-4)
    monkeypatch.setattr(web, "_MESHES", 400)
    thin = hull()
    assert 100 < len(thin) <= 200
    # Measured 0.92: a sphere with fewer vertices has less volume.
    assert np.linalg.det(thin).sum() / np.linalg.det(whole).sum() == pytest.approx(0.92, abs=0.05)


@pytest.mark.usefixtures("screen")
def test_a_film_of_a_users_robot_shows_its_mesh_without_a_note_on_rotors(tmp_path: Path) -> None:
    """The green of the wheel covers 0.1 % of the picture, and nothing if the wheel is grey.

    A rotor that rotates by 0.3 rad per frame would lose its marks, which a note explains.
    """
    film, greens = Film(size=(240, 480)), []
    green, grey = motion_of("meshed.xml")[0], MESHED.replace("0 1 0 1", ".5 .5 .5 1")
    # The colour does not change the motion.
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
def test_the_triangles_of_a_body_enclose_its_volume(
    kind: Any, sizes: tuple[float, ...], volume: float
) -> None:
    """By the divergence theorem, so all triangles are anticlockwise from outside.

    A bar with 48 sides lacks 0.3 % of the volume of a round one, a tube with 8 sides 10 %.
    """
    turn, pos = np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 2.0, 3.0])
    corners = Shape(kind, np.array(sizes), pos, turn, "frame").triangles
    assert 0.89 * volume < np.linalg.det(corners).sum() / 6 < volume * (1 + 1e-12)
