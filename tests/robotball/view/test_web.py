"""The 3-D view of a page draws, plays, scrubs and orbits in a browser without a network."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.rotations import rotation_matrix
from robotball.view.web import MOST, STEP, view_data, view_fragment, view_page
from tests.browser import needs_browser, opened
from tests.messages import naming, unnamed
from tests.poses import poses
from tests.random_robots import random_tree

TIMES = np.linspace(0.0, 2.0, 101)  # s
THEORY = rb.integrate(rb.load_scene("three_rotors"), TIMES)


def test_a_view_contains_the_motion() -> None:
    """Rows are contact points in radii, attitudes and hinge angles, as 32-bit floats."""
    data = view_data([THEORY])
    rows = np.frombuffer(b64decode(data["balls"][0]["rows"]), "<f4").reshape(len(TIMES), -1)
    expected = [
        THEORY.contact_point / THEORY.scene.ball.radius,
        THEORY.attitude,
        THEORY.hinge_angles,
    ]
    # Measured 1e-5 for an angle of 300 rad: rounding to 32 bits.
    assert np.allclose(rows, np.column_stack(expected), rtol=1e-7, atol=1e-6)
    assert data["step"] == STEP


SLIPPING = replace(THEORY, slipping=((0.51, 1.01),))
LOOK = """(async t => {
const view = document.querySelector(".rb-view"), canvas = view.querySelector("canvas");
view.rollingBalls.set({t, playing: false});
while (+view.dataset.drawn !== t) await new Promise(requestAnimationFrame);
const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
copy.drawImage(canvas, 0, 0);
const pixels = copy.getImageData(0, 0, canvas.width, canvas.height).data;
let yellow = 0;
for (let i = 0; i < pixels.length; i += 4)
  yellow += pixels[i] > 220 && pixels[i + 1] > 200 && pixels[i + 2] < 90;
return [view.querySelector(".rb-name").textContent, yellow];
})"""


def test_a_view_has_the_samples_with_slip() -> None:
    """And those around them, and a note."""
    assert view_data([SLIPPING])["balls"][0]["slips"] == [(25, 52)]
    assert unnamed("Yellow slips", view_fragment([SLIPPING])) == []
    assert "Yellow" not in view_fragment([THEORY])


@needs_browser
@pytest.mark.slow
def test_a_view_shows_where_the_ball_slips(tmp_path: Path) -> None:
    """A yellow band appears under its path, and a word beside its name while it slips."""
    with opened(view_page([SLIPPING]), tmp_path, 800) as browser:
        before, during, after = (browser.run(f"{LOOK}({t})") for t in (0.4, 0.8, 1.6))
        assert browser.console == []
    assert [name for name, _ in (before, during, after)] == [
        "equations", "equations, slipping", "equations"
    ]  # fmt: skip
    # Measured 26, 152 and 357; a rotor is golden.
    assert 2 * before[1] < during[1] < after[1]


def test_a_motion_too_long_or_too_short_for_a_view_is_reported() -> None:
    """A thousandfold duration is cut to MOST samples; one that ended at its start is refused."""
    long = replace(THEORY, times=THEORY.times * 1000)
    assert view_data([long])["count"] == MOST
    assert unnamed("399.98~s 2000~s", view_fragment([long])) == []
    with pytest.raises(rb.InputError, match=naming("two")):
        view_fragment([replace(THEORY, times=THEORY.times[:1])])


def test_a_title_is_escaped_and_the_page_needs_no_other_file() -> None:
    """Whatever the scene's name: no markup, no address, no file."""
    scene = replace(THEORY.scene, title="<b>&</script>", name='a"</script>')
    page = view_page([replace(THEORY, scene=scene)])
    assert "<b>" not in page
    assert page.count("</script>") == page.count("<script")
    found = re.search(r'<script type="application/json">(.*?)</script>', page)
    assert found is not None
    assert json.loads(found[1])["balls"][0]["name"] == THEORY.engine.name
    assert "http" not in page
    assert re.findall(r'(?:src|href)="(?!data:)', page) == []


DRIVE = """(async () => {
const view = document.querySelector(".rb-view"), canvas = view.querySelector("canvas");
const find = name => view.querySelector(`[data-is=${name}]`), shots = [];
const wait = () => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
const shot = async () => { await wait(); shots.push(canvas.toDataURL()); };
const at = () => +view.dataset.drawn;
find("play").click(); await wait(); await shot(); await shot();
const bar = find("time"); bar.value = 1.5; bar.oninput(); await shot(); const scrubbed = at();
const point = (kind, clientX, clientY) =>
  canvas.dispatchEvent(new PointerEvent(kind, {clientX, clientY, pointerId: 1}));
canvas.setPointerCapture = () => {};
point("pointerdown", 100, 100); point("pointermove", 160, 120); point("pointerup", 160, 120);
await shot();
find("ghost").click(); await shot();
find("play").click(); while (at() === scrubbed) await wait();
return {scrubbed, played: at(), distinct: new Set(shots).size, still: shots[0] === shots[1],
        size: shots[0].length, line: find("line").textContent,
        overflow: document.documentElement.scrollWidth - innerWidth,
        names: [...view.querySelectorAll(".rb-name")].map(name => name.textContent)};
})()"""
PLACES = """[...document.querySelectorAll(".rb-view")].map(({rollingBalls}) => {
  rollingBalls.set({t: 1.0, playing: false}); return rollingBalls.places();
})"""


@needs_browser
@pytest.mark.slow
def test_a_view_plays_scrubs_and_orbits(tmp_path: Path) -> None:
    """Paused, it does not change; scrubbing, orbiting and overlaying change the picture."""
    moved = replace(THEORY, contact_point=THEORY.contact_point * 1.5)
    with opened(view_page([moved, THEORY]), tmp_path, 360) as browser:
        told = browser.run(DRIVE)
        assert browser.console == []
        assert [
            request for request in browser.requests if not request.startswith(("file:", "data:"))
        ] == []
    assert told["still"]
    assert told["distinct"] == 4
    assert told["size"] > 20_000  # an empty picture has 2 to 10 thousand characters
    assert told["scrubbed"] == pytest.approx(1.5, abs=1e-6)
    assert told["played"] != told["scrubbed"]
    assert re.fullmatch(r"t = \d\.\d\d s", told["line"])
    assert re.fullmatch(r"equations\n\d\.\d+ m off", told["names"][0])
    assert told["names"][1] == "equations"
    assert told["overflow"] <= 0


@needs_browser
@pytest.mark.slow
def test_bodies_in_a_view_have_the_poses_of_the_motion(tmp_path: Path) -> None:
    """Rotors and trees with slides, with and without a frame, three views on a page.

    At t = 1 s, compared with `poses`; measured 1.5e-6: 32 bits for a rotor's angle.
    """
    trees = (random_tree(np.random.default_rng(3), framed) for framed in (False, True))
    motions = [THEORY, *(rb.integrate(tree, TIMES[:76]) for tree in trees)]
    with opened(
        view_page([THEORY]) + "".join(view_fragment([motion]) for motion in motions[1:]), tmp_path
    ) as browser:
        found = browser.run(PLACES)
    off = []
    for motion, places in zip(motions, found, strict=True):
        ball, row = motion.scene.ball, int(np.argmin(np.abs(motion.times - 1.0)))
        for (name, body), columns in zip(ball.named_bodies, places, strict=True):
            matrix, expected = np.array(columns).reshape(4, 4).T, poses(motion)[name]
            off.append(matrix[:3, :3] - rotation_matrix(expected.attitude[row]))
            centre = matrix[:3, 3] + matrix[:3, :3] @ body.centre / ball.radius
            off.append(centre - expected.position[row] / ball.radius)
    assert max(np.abs(errors).max() for errors in off) < 3e-6
