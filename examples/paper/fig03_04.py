"""Figs 3 and 4: the structure of the ball of Fig. 12, and the axes of space and of its frame.

In Fig. 3 the frame turns in the shell about Ω, and the rotor in the frame about n₁. MuJoCo's
renderer draws the bodies; it needs off-screen OpenGL. Lengths are in radii.

python examples/paper/fig03_04.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import robotball as rb
from robotball.robot.looks import looks_of
from robotball.rotations import rotation_matrix
from robotball.view import gl
from robotball.view.stage import Camera, Stage
from robotball.view.tracks import track_of

SIZE = 800, 1000  # pixels, height and width


def main() -> dict[str, float]:
    """Draw both figures; return the distance from O to P in Fig. 4 and MuJoCo's error there [m]."""
    times = rb.sample_times(0.8)  # s, of the path in Fig. 4
    theory, engine = rb.integrate("fig12", times), rb.simulate("fig12", times)
    ball, first, last = theory.scene.ball, *rotation_matrix(theory.attitude[[0, -1]])
    up, centre = np.array([0.0, 0.0, 1.0]), np.append(theory.contact_point[-1] / ball.radius, 1.0)
    axis, rotor = first @ ball.shell.axis, first @ ball.rotors[0].axis
    parts = {"Ω": (up + axis, up + 1.5 * axis, "#CC3311"), "n₁": (up, up + 1.1 * rotor, "#8A5A00")}
    space = {"XYZ"[i]: (0 * up, 1.3 * np.eye(3)[i], "#22262B") for i in range(3)}
    space |= {f"x{i + 1}": (centre, centre + 1.5 * last[:, i], "#117733") for i in range(3)}
    near = Camera(0.9 * up, 4.6, azimuth=2.34, elevation=0.18)
    far = Camera(0.5 * centre + 0.4 * up, 6.5, azimuth=2.29, elevation=0.28)
    track, looks, backend = track_of(theory), looks_of(ball), gl.find_backend()
    if backend is None:
        raise rb.InputError(gl.advice())
    for number, time, camera, arrows in ((3, 0.0, near, parts), (4, times[-1], far, space)):
        axes = Figure((10, 8)).add_axes((0.0, 0.0, 1.0, 1.0))
        stage = Stage(SIZE, looks, ["#5A7A9A"], [track.points], camera.distance, backend)
        stage.place([track.stands(track.at(np.array([time])))], [dict.fromkeys(track.names, 0.0)])
        axes.imshow(stage.draw(camera, [1.0], [0.0], 0, [*arrows.values()]), aspect="auto")
        stage.close()
        for motion, width in ((theory, 4.0), (engine, 1.2)) if number == 4 else ():
            path = [camera.project([*point, 0.0], SIZE)[:2] for point in track_of(motion).points]
            axes.plot(*np.array(path).T, color=motion.engine.colour, lw=width)
        points = {name: end + 0.12 * (end - begin) for name, (begin, end, _) in arrows.items()}
        points |= {"C": up} if number == 3 else {"O": 0 * up, "C": centre, "P": centre - up}
        for name, point in points.items():
            axes.text(*camera.project(point, SIZE)[:2], name, ha="center", fontsize=16)
        axes.set_axis_off()
        Path("out").mkdir(exist_ok=True)
        axes.figure.savefig(f"out/fig{number:02}.png")
    gap = np.linalg.norm(engine.contact_point[-1] - theory.contact_point[-1])
    return {"O to P": np.linalg.norm(theory.contact_point[-1]), "path error": gap}


if __name__ == "__main__":
    print("out/fig03.png, out/fig04.png", main())
