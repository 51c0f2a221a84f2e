"""Play motions simultaneously in MuJoCo's interactive viewer, the last one as a ghost."""

import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robotball.errors import InputError
from robotball.motion import Motion
from robotball.robot.looks import GHOST, looks_of
from robotball.view.stage import build_stage, pose
from robotball.view.tracks import colours_of, track_of

KEYS = "space: pause; left, right: half a second; up, down: twice or half the speed; home: start"
_CODES = {32: "space", 268: "home", 262: "right", 263: "left", 264: "down", 265: "up"}  # of GLFW
_JUMP, _FRAME = 0.5, 1 / 60  # s: jump of an arrow key; time between two pictures in the window


@dataclass
class Clock:
    """Playback time [s] and speed, controlled by keys."""

    end: float
    t: float = 0.0
    speed: float = 1.0
    playing: bool = True

    def key(self, code: int) -> None:
        """Apply a key of the viewer, given by its GLFW code."""
        match _CODES.get(code):
            case "space":
                self.playing = not self.playing
            case "left" | "right" as key:
                jump = _JUMP if key == "right" else -_JUMP
                self.t = float(np.clip(self.t + jump, 0.0, self.end))
            case "up" | "down" as key:
                self.speed *= 2.0 if key == "up" else 0.5
            case "home":
                self.t = 0.0

    def pass_on(self, seconds: float) -> None:
        """Advance by real time [s]; after the end, restart from 0."""
        if self.playing:
            self.t += seconds * self.speed
            if self.t > self.end:
                self.t = 0.0


def check_display() -> None:
    """Raise InputError if no window can be opened."""
    no_display = "no display for a viewer; --web writes a page for any browser instead"
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError(no_display)
    # macOS opens windows only in the main thread, which mjpython leaves to the viewer.
    if sys.platform == "darwin" and "mjpython" not in os.environ.get("MJPYTHON_BIN", ""):
        raise InputError("on macOS the viewer needs mjpython instead of python; or use --web")
    import warnings

    import glfw  # late: only a window needs it

    # glfw reports the failure as the return value and as a warning.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if not glfw.init():
            raise InputError(no_display)


def view(motions: Sequence[Motion]) -> None:
    """Show motions of a scene until the window is closed. Raises InputError without a display."""
    check_display()
    from mujoco import viewer

    tracks, looks = list(map(track_of, motions)), looks_of(motions[-1].scene.ball)
    colours, opacities = colours_of(motions), [1.0] * (len(motions) - 1) + [GHOST]
    model = build_stage(looks, colours, opacities).compile()
    data = mujoco.MjData(model)
    clock = Clock(max(float(motion.times[-1]) for motion in motions))
    before = time.monotonic()
    with viewer.launch_passive(
        model, data, key_callback=clock.key, show_left_ui=False, show_right_ui=False
    ) as window:
        window.cam.elevation, window.cam.distance = -22.0, 9.0
        while window.is_running():
            now = time.monotonic()
            clock.pass_on(now - before)
            before = now
            at = np.array([clock.t])
            stands = [track.stands(track.at(at)) for track in tracks]
            # The viewer draws from the same data in another thread.
            with window.lock():
                pose(model, data, looks, stands)
                window.cam.lookat[:] = np.mean([ball["shell"][1][0] for ball in stands], axis=0)
            corner = mujoco.mjtFontScale.mjFONTSCALE_150, mujoco.mjtGridPos.mjGRID_TOPLEFT
            window.set_texts((*corner, f"t = {clock.t:.2f} s   {clock.speed:g} x", ""))
            window.sync()
            time.sleep(max(0.0, _FRAME - (time.monotonic() - now)))
