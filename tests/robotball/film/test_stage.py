"""The stage: what is added to MuJoCo's scene stands where it should."""

import numpy as np
import pytest

import robotball as rb
from robotball.film import gl, stage
from robotball.film.looks import looks_of
from robotball.film.stage import LENS, SUN, Camera, Stage, build_stage
from robotball.film.tracks import track_of
from robotball.rotations import Array

TIMES = np.linspace(0.0, 0.3, 16)  # s
SIDE = 200  # pixels
HIGH = 9.0  # radii


def drawn(points: Array, opacity: float, trail: float) -> tuple[Array, Array]:
    """A picture of fig12's ball from above with a path, and where the ball stands."""
    scene = rb.load_scene("fig12")
    track = track_of(rb.integrate(scene, TIMES))
    stands = track.stands(track.at(TIMES[:1]))
    looks = looks_of(scene.ball)
    shown = Stage((SIDE, SIDE), looks, ["#0072B2"], [points], 7.2, gl.find_backend())
    shown.place([stands], [{}])
    centre = stands["shell"][1][0]
    camera = Camera(np.array([*centre[:2], 0.0]), HIGH, 0.0, np.pi / 2 - 1e-4)
    picture = shown.draw(camera, [opacity], [trail], len(points) - 1)
    shown.close()
    return picture.astype(float), centre


def at(picture: Array, point: Array) -> Array:
    """The pixels (9, 3) around a point (2,) on the floor, from the picture's middle."""
    x, y = SIDE / 2 * (1 + LENS / HIGH * np.array([point[1], point[0]]))
    return picture[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2].reshape(9, 3)


def test_the_sun_of_the_shadows_is_that_of_the_floor() -> None:
    """By its direction in mjcf/floor.xml."""
    model = build_stage({}, [], []).compile()
    assert model.light("sun").dir == pytest.approx(SUN / np.linalg.norm(SUN))


@pytest.mark.usefixtures("screen")
def test_a_shadow_lies_on_the_side_away_from_the_sun() -> None:
    """One radius past the ball's outline; measured 42 levels of 255, and 0 on the sun's side."""
    path = np.array([[0.0, 3.0], [1.0, 3.0]])
    bare, shaded = (drawn(path, opacity, 0.0)[0] for opacity in (0.0, 1.0))
    away = 1.25 * SUN[:2] / np.linalg.norm(SUN[:2])
    assert (at(bare, away) - at(shaded, away)).mean() > 15
    assert np.abs(at(bare, -away) - at(shaded, -away)).max() < 2


@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize("points", [stage.POINTS, 10])
def test_a_path_is_drawn_to_its_end(points: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole, and thinned; its blue is there, and not where the path has not been."""
    monkeypatch.setattr(stage, "POINTS", points)
    _, centre = drawn(np.array([[0.0, 3.0], [1.0, 3.0]]), 0.0, 0.0)
    line = np.column_stack([np.linspace(-1.0, 1.0, 101), np.full(101, 1.8)]) + centre[:2]
    picture, _ = drawn(line, 0.0, 1.0)
    for x, blue in ((-0.8, True), (0.0, True), (0.9, True), (1.5, False)):
        red, _, strong = at(picture, np.array([x, 1.8])).mean(axis=0)
        assert (strong - red > 50) == blue
