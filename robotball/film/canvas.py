"""The canvas: balls, paths and arrows on a floor → pixels, by off-screen OpenGL 2.1.

The floor and the paths average their own edges. Only what is near a ball is drawn with several
samples a pixel, and shadows are the bodies themselves, laid flat: so two cores without a GPU draw
a talk's film faster than it plays.
"""

from collections.abc import Mapping, Sequence
from ctypes import c_void_p
from typing import Any

import numpy as np
import OpenGL
from numpy.typing import NDArray

from robotball import palette
from robotball.film import gl
from robotball.film.camera import Camera
from robotball.film.pane import SUN, Drawn, Pane, around
from robotball.film.shaders import Kind, framebuffer, linked
from robotball.film.triangles import triangles_of
from robotball.looks import BLUR, MARKS, Shape, colours
from robotball.rotations import Array

Pixels = NDArray[np.uint8]
SAMPLES = 4
SKY, TILE = (0.96, 0.965, 0.97), (0.89, 0.9, 0.915)
OWN = ("shell", "mark")  # the materials that have the engine's colour
GLASS, SHADE = 0.13, 0.2  # how dark a shadow is
LIFT = 0.006  # of a path over the floor
WIDE = 60.0  # the floor, to each side
FLOOR = np.array([[x, y, 0, 0, 0, 1] for x, y in
                  ((-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1))], dtype=float)  # fmt: skip


class Canvas:
    """Draws pictures of balls that look alike.

    size: (height, width) in pixels; backend: as `gl.find_backend` told. Raises OSError where
    there is no off-screen GL. To be closed.
    """

    def __init__(
        self,
        size: tuple[int, int],
        looks: Mapping[str, Sequence[Shape]],
        backend: str | None,
    ) -> None:
        self.height, self.width = size
        self._context = gl.context(self.width, self.height, backend)
        OpenGL.ERROR_CHECKING = False  # a check takes as long as the call before it
        from OpenGL import GL  # whose platform is chosen by the context

        self._gl: Any = GL
        self._program = linked(GL)
        GL.glUseProgram(self._program)
        self._at = {
            name: GL.glGetUniformLocation(self._program, name)
            for name in ("view", "place", "sun", "kind", "colour", "eye", "look", "sky", "tile")
        }
        samples = min(SAMPLES, int(GL.glGetIntegerv(GL.GL_MAX_SAMPLES)))
        self._smooth, self._whole = (
            framebuffer(GL, size, samples, deep=True),
            framebuffer(GL, size, 0),
        )
        self._kept: dict[str, tuple[int, int, int]] = {}
        self.keep("floor", FLOOR)
        self._parts: list[tuple[str, str, str]] = []
        for body, shapes in looks.items():
            for material in dict.fromkeys(shape.material for shape in shapes):
                name = f"{body} {material}"
                own = [triangles_of(shape) for shape in shapes if shape.material == material]
                self.keep(name, np.concatenate(own))
                self._parts.append((name, body, material))
        for name, value in (("sun", SUN), ("sky", SKY), ("tile", TILE)):
            GL.glUniform3f(self._at[name], *map(float, value))
        GL.glClearColor(*SKY, 1.0)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        GL.glBlendFunc(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
        GL.glEnable(GL.GL_BLEND)

    def keep(self, name: str, corners: Array, *, strip: bool = False) -> None:
        """Keeps the corners (n, 6) of triangles, or of a strip, to be drawn by their name."""
        GL = self._gl
        numbers: Any = corners.astype(np.float32)
        order: Any = np.zeros(0)
        if not strip:  # each corner is shaded once for all of its triangles
            numbers, order = np.unique(numbers, axis=0, return_inverse=True)
        buffers = self._kept[name][:2] if name in self._kept else map(int, GL.glGenBuffers(2))
        first, second = buffers
        for target, buffer, array in (
            (GL.GL_ARRAY_BUFFER, first, np.ascontiguousarray(numbers)),
            (GL.GL_ELEMENT_ARRAY_BUFFER, second, order.ravel().astype(np.uint32)),
        ):
            GL.glBindBuffer(target, buffer)
            GL.glBufferData(target, array.nbytes, array, GL.GL_STATIC_DRAW)
        self._kept[name] = (first, second, len(corners))

    def draw(self, panes: Sequence[Pane]) -> Pixels:
        """The panes side by side, each as wide as the others: (height, width, 3)."""
        GL = self._gl
        self._context.make_current()
        width = self.width // len(panes)
        lefts = [width * i for i in range(len(panes))]
        GL.glDisable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._whole)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT)
        for left, pane in zip(lefts, panes, strict=True):
            self._look(left, width, pane.camera)
            self._floor(pane)
        GL.glEnable(GL.GL_SCISSOR_TEST)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._smooth)
        areas = []
        for left, pane in zip(lefts, panes, strict=True):
            x, y, w, h = pane.camera.frame(around(pane), width, self.height)
            areas.append((left + x, y, left + x + w, y + h))
            GL.glScissor(left + x, y, w, h)
            self._look(left, width, pane.camera)
            GL.glDisable(GL.GL_DEPTH_TEST)
            GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT | GL.GL_STENCIL_BUFFER_BIT)
            self._floor(pane, shadows=True)
            GL.glEnable(GL.GL_DEPTH_TEST)
            self._solids(pane)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._whole)
        for area in areas:
            GL.glBlitFramebuffer(*area, *area, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._whole)
        pixels = np.empty((self.height, self.width, 3), dtype=np.uint8)
        GL.glReadPixels(0, 0, self.width, self.height, GL.GL_RGB, GL.GL_UNSIGNED_BYTE, pixels)
        return pixels[::-1]  # GL's rows run upwards

    def _look(self, left: int, width: int, camera: Camera) -> None:
        GL = self._gl
        GL.glViewport(left, 0, width, self.height)
        GL.glUniformMatrix4fv(self._at["view"], 1, True, camera.matrix(width, self.height))
        GL.glUniform3f(self._at["eye"], *map(float, camera.eye))
        GL.glUniform3f(self._at["look"], *map(float, camera.look))

    def _floor(self, pane: Pane, *, shadows: bool = False) -> None:
        """The floor with what lies on it; the first line lies over the others."""
        ground = np.diag([WIDE, WIDE, 1.0, 1.0])
        ground[:2, 3] = pane.camera.look[:2]
        self._draw("floor", Kind.FLOOR, ground, (0, 0, 0, 1))
        if shadows:
            self._shadows(pane.balls)
        lifted = np.eye(4)
        lifted[2, 3] = LIFT
        for line in reversed(pane.lines):
            if line.count >= 4:
                rgba = (*palette.rgb(line.colour), line.opacity)
                self._draw(line.strip, Kind.PATH, lifted, rgba, line.count)

    def _shadows(self, balls: Sequence[Drawn]) -> None:
        GL = self._gl
        GL.glEnable(GL.GL_STENCIL_TEST)
        GL.glStencilOp(GL.GL_KEEP, GL.GL_KEEP, GL.GL_INCR)
        for level, glass in ((0, True), (1, False)):  # no pixel is darkened twice
            GL.glStencilFunc(GL.GL_GEQUAL, level, 255)
            GL.glEnable(GL.GL_CULL_FACE)
            GL.glCullFace(GL.GL_BACK)
            for ball in balls:
                for name, body, material in self._parts:
                    if (material == "shell") == glass and material not in (BLUR, MARKS):
                        dark = (0, 0, 0, (GLASS if glass else SHADE) * ball.opacity)
                        self._draw(name, Kind.SHADOW, ball.stands[body], dark)
        GL.glDisable(GL.GL_STENCIL_TEST)
        GL.glDisable(GL.GL_CULL_FACE)

    def _solids(self, pane: Pane) -> None:
        GL = self._gl
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glCullFace(GL.GL_BACK)
        for i, each in enumerate(pane.loose):
            self.keep(f"loose {i}", each.corners)
            self._draw(f"loose {i}", Kind.LIT, np.eye(4), (*palette.rgb(each.colour), 1.0))
        clear = []
        for ball in pane.balls:
            for name, body, material in self._parts:
                red, green, blue, opacity = colours()[material]
                rgb = palette.rgb(ball.colour) if material in OWN else (red, green, blue)
                fast = ball.blurred.get(body, 0.0)
                opacity *= ball.opacity * {MARKS: 1 - fast, BLUR: fast}.get(material, 1.0)
                kind = Kind.GLASS if material == "shell" else Kind.LIT
                job = (name, kind, ball.stands[body], (*rgb, opacity))
                if opacity > 0.99:
                    self._draw(*job)
                elif opacity > 0.01:
                    clear.append(job)
        GL.glDepthMask(False)
        for side in (GL.GL_FRONT, GL.GL_BACK):
            GL.glCullFace(side)
            for job in clear:
                self._draw(*job)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDepthMask(True)

    def _draw(
        self,
        name: str,
        kind: Kind,
        place: Array,
        rgba: tuple[float, ...],
        count: int | None = None,
    ) -> None:
        """Draws triangles that are kept, or so many corners of a strip."""
        GL = self._gl
        corners, order, whole = self._kept[name]
        GL.glUniform1i(self._at["kind"], int(kind))
        GL.glUniformMatrix4fv(self._at["place"], 1, True, place.astype(np.float32))
        GL.glUniform4f(self._at["colour"], *map(float, rgba))
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, corners)
        for index in (0, 1):
            GL.glEnableVertexAttribArray(index)
            GL.glVertexAttribPointer(index, 3, GL.GL_FLOAT, False, 24, c_void_p(12 * index))
        if count is not None:
            GL.glDrawArrays(GL.GL_TRIANGLE_STRIP, 0, count)
            return
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, order)
        GL.glDrawElements(GL.GL_TRIANGLES, whole, GL.GL_UNSIGNED_INT, None)

    def close(self) -> None:
        """Frees what GL holds."""
        self._context.free()
