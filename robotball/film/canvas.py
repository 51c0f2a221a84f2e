"""The canvas: a MuJoCo model, a camera and a few loose shapes → pixels, by off-screen GL."""

from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotball import palette
from robotball.film import gl
from robotball.rotations import Array

Pixels = NDArray[np.uint8]


class Canvas:
    """Draws pictures of one model: `begin`, then any number of `add`, then `finish`.

    size: (height, width) in pixels; spare: how many shapes may be added to a picture;
    backend: the GL, found anew if None. Raises
    OSError where there is no off-screen GL. To be closed, or used in a `with`.
    """

    def __init__(
        self, model: mujoco.MjModel, size: tuple[int, int], spare: int, backend: str | None = None
    ) -> None:
        self.height, self.width = size
        self._context = gl.context(self.width, self.height, backend or gl.find_backend())
        model.vis.global_.offheight, model.vis.global_.offwidth = size
        model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self._model = model
        self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._renderer)
        self._view = mujoco.MjvScene(model, maxgeom=model.ngeom + spare)
        # Either would draw everything once more.
        self._view.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        self._view.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False

    def begin(self, data: mujoco.MjData, camera: mujoco.MjvCamera) -> None:
        """Starts a picture of the model as posed in `data`."""
        everything = mujoco.mjtCatBit.mjCAT_ALL
        option = mujoco.MjvOption()
        mujoco.mjv_updateScene(self._model, data, option, None, camera, everything, self._view)

    def add(
        self,
        kind: mujoco.mjtGeom,
        size: Array,
        pos: Array,
        turn: Array,
        colour: str,
        opacity: float = 1.0,
    ) -> None:
        """Adds a shape to the picture: size (3,) as in MJCF, pos (3,), turn (3, 3), world axes."""
        rgba = np.array([*palette.rgb(colour), opacity], dtype=np.float32)
        shape = self._view.geoms[self._view.ngeom]
        mujoco.mjv_initGeom(shape, kind, size, pos, turn.ravel(), rgba)
        self._view.ngeom += 1

    def finish(self) -> Pixels:
        """The picture (height, width, 3)."""
        pixels = np.empty((self.height, self.width, 3), dtype=np.uint8)
        whole = mujoco.MjrRect(0, 0, self.width, self.height)
        self._context.make_current()
        mujoco.mjr_render(whole, self._view, self._renderer)
        mujoco.mjr_readPixels(pixels, None, whole, self._renderer)
        return pixels[::-1]  # GL's rows run upwards

    def pixel(self, point: Array) -> tuple[float, float]:
        """Where (x, y) the picture begun last shows a point (3,) of the world."""
        eye = mujoco.mjv_averageCamera(*self._view.camera)
        arm = point - eye.pos
        scale = self.height / 2 * eye.frustum_near / eye.frustum_top / (arm @ eye.forward)
        x, y = arm @ np.cross(eye.forward, eye.up), arm @ eye.up
        return self.width / 2 + scale * float(x), self.height / 2 - scale * float(y)

    def close(self) -> None:
        """Frees what GL holds."""
        self._context.make_current()
        self._renderer.free()
        self._context.free()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
