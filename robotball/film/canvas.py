"""Draw balls, paths, arrows and shadows on a floor by off-screen OpenGL 2.1.

The two shaders also draw the 3-D view of a page: they are written in what GLSL 1.20 and GLSL ES
3.00 share but for a few names. Surfaces are triangles, corners (n, 6) with a place and a normal
each, three a triangle.

Multisampling a whole picture takes most of its time without a GPU. So floor and paths average
their own edges in the shader, and only the surroundings of a ball are drawn with several samples a
pixel. Shadows are the bodies projected onto the floor along the light.
"""

from collections.abc import Mapping, Sequence
from ctypes import c_void_p
from dataclasses import dataclass
from enum import IntEnum
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import OpenGL
from numpy.typing import NDArray

from robotball.film import gl
from robotball.film import looks as palette
from robotball.film.looks import BLUR, MARKS, Shape, colours
from robotball.rotations import Array, rotation_matrix, z_along

HERE = Path(__file__).parent


class Kind(IntEnum):
    """How the light on a surface is computed."""

    LIT, FLOOR, GLASS, SHADOW, PATH = range(5)


KINDS = "".join(f"#define {kind.name} {kind.value}\n" for kind in Kind)
DESKTOP = (
    "#version 120\n#define ATTRIBUTE attribute\n#define PASSED_ON varying\n"
    "#define PASSED varying\n#define SEEN gl_FragColor\n"
)
PAGE = (
    "#version 300 es\nprecision highp float;\nprecision highp int;\n#define ATTRIBUTE in\n"
    "#define PASSED_ON out\n#define PASSED in\n"
)


def shaders(page: bool = False) -> tuple[str, str]:
    """Return the vertex and fragment shaders, for a page's WebGL 2 or for OpenGL 2.1."""
    head = (PAGE if page else DESKTOP) + KINDS
    vertex, fragment = ((HERE / f"shade.{name}").read_text("utf-8") for name in ("vert", "frag"))
    return head + vertex, head + ("out vec4 SEEN;\n" if page else "") + fragment


def linked(GL: Any) -> int:
    """Compile and link the shaders in the current OpenGL. Raises OSError if it refuses them."""
    program = GL.glCreateProgram()
    for kind, text in zip((GL.GL_VERTEX_SHADER, GL.GL_FRAGMENT_SHADER), shaders(), strict=True):
        shader = GL.glCreateShader(kind)
        GL.glShaderSource(shader, text)
        GL.glCompileShader(shader)
        if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
            raise OSError(f"this OpenGL refuses a shader: {GL.glGetShaderInfoLog(shader)!r}")
        GL.glAttachShader(program, shader)
    for index, name in enumerate(("corner", "normal")):
        GL.glBindAttribLocation(program, index, name)
    GL.glLinkProgram(program)
    return int(program)


def framebuffer(GL: Any, size: tuple[int, int], samples: int, *, deep: bool = False) -> int:
    """Return a framebuffer (height, width); deep: with depth and stencil.

    Raises OSError if this OpenGL has no framebuffers.
    """
    height, width = size
    made = int(GL.glGenFramebuffers(1))
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, made)
    wanted = [(GL.GL_RGBA8, GL.GL_COLOR_ATTACHMENT0)]
    if deep:
        wanted.append((GL.GL_DEPTH24_STENCIL8, GL.GL_DEPTH_STENCIL_ATTACHMENT))
    for storage, attachment in wanted:
        buffer = GL.glGenRenderbuffers(1)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, storage, width, height)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)
    if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
        raise OSError("this OpenGL has no framebuffers to draw a film in")
    return made


AROUND = 48  # steps of a shape about its axis
SECTION = 8  # of a torus's tube, and of a round end
SMALL = 12  # steps about the axis of a thin shape


def triangles_of(shape: Shape) -> Array:
    """Return the triangles (n, 6) of a shape in its body's axes; lengths in radii of the ball."""
    own = _box(shape.size) if shape.kind == "box" else _turned(*_profile(shape))
    return moved(own, rotation_matrix(shape.turn), shape.pos)


def moved(corners: Array, turn: Array, pos: Array) -> Array:
    """Turn corners (n, 6) by a matrix (3, 3) and then shift them by (3,)."""
    return np.concatenate([corners[:, :3] @ turn.T + pos, corners[:, 3:] @ turn.T], axis=1)


def arrow(vector: Array, thickness: float) -> Array:
    """Return an arrow (n, 6) from the origin to the tip of `vector` (3,)."""
    length = float(np.linalg.norm(vector))
    head = min(4 * thickness, length / 2)
    neck, slope = length - head, np.array([head, 2 * thickness]) / np.hypot(head, 2 * thickness)
    profile = [
        (0.0, 0.0, 0.0, -1.0), (thickness, 0.0, 0.0, -1.0), (thickness, 0.0, 1.0, 0.0),
        (thickness, neck, 1.0, 0.0), (thickness, neck, 0.0, -1.0), (2 * thickness, neck, 0.0, -1.0),
        (2 * thickness, neck, *slope), (0.0, length, *slope),
    ]  # fmt: skip
    return moved(
        _turned(np.array(profile), SMALL), rotation_matrix(z_along(vector / length)), np.zeros(3)
    )


def _profile(shape: Shape) -> tuple[Array, int]:
    """Return the section (m, 4) of a shape turned about z, r, z and normal, and its steps."""
    a, b, _ = shape.size
    if shape.kind == "torus":
        c, s = _circle(0.0, 2 * np.pi, SECTION)
        return np.stack([a + b * c, b * s, c, s], axis=1), AROUND
    if shape.kind == "sphere":
        c, s = _circle(-np.pi / 2, np.pi / 2, 2 * SECTION if a > 0.5 else SECTION)
        return np.stack([a * c, a * s, c, s], axis=1), AROUND if a > 0.5 else SMALL
    if shape.kind == "capsule":
        c, s = _circle(-np.pi / 2, np.pi / 2, SECTION)
        return np.stack([a * c, a * s + b * np.where(s > 0, 1, -1), c, s], axis=1), SMALL
    flat, side = (0.0, 1.0), (1.0, 0.0)
    edges = [(0, -b, 0, -1), (a, -b, 0, -1), (a, -b, *side), (a, b, *side), (a, b, *flat),
             (0, b, *flat)]  # fmt: skip
    return np.array(edges, dtype=float), AROUND


def _circle(begin: float, end: float, steps: int) -> tuple[Array, Array]:
    angle = np.linspace(begin, end, steps + 1)
    return np.cos(angle), np.sin(angle)


def _turned(profile: Array, steps: int) -> Array:
    """Return the surface that a profile (m, 4) sweeps when it is turned about z."""
    c, s = _circle(0.0, 2 * np.pi, steps)
    r, z, nr, nz = profile.T
    grid = np.stack(
        [
            np.outer(c, r), np.outer(s, r), np.outer(np.ones_like(c), z),
            np.outer(c, nr), np.outer(s, nr), np.outer(np.ones_like(c), nz),
        ],
        axis=2,
    )  # fmt: skip
    return _faces(grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])


def _faces(a: Array, b: Array, c: Array, d: Array) -> Array:
    return np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 6)


def _box(size: Array) -> Array:
    corners = []
    square: Sequence[tuple[int, int]] = ((-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1))
    for axis in range(3):
        for side in (-1, 1):
            for a, b in square[::side]:  # anticlockwise from outside, as OpenGL culls
                place, normal = np.zeros(3), np.zeros(3)
                place[axis] = normal[axis] = side
                place[(axis + 1) % 3], place[(axis + 2) % 3] = a, b
                corners.append(np.concatenate([place * size, normal]))
    return np.array(corners)


LENS = 3.1  # the distance at which the picture's height is 2
NEAR, FAR = 0.1, 300.0
EDGE = 3  # pixels around what is framed


@dataclass(frozen=True)
class Camera:
    """A view of a point (3,) from a distance, azimuth and elevation [rad]; lengths in radii."""

    look: Array
    distance: float
    azimuth: float
    elevation: float

    @property
    def back(self) -> Array:
        """The unit vector (3,) from the point to the eye."""
        c = np.cos(self.elevation)
        return np.array(
            [c * np.cos(self.azimuth), c * np.sin(self.azimuth), np.sin(self.elevation)]
        )

    @property
    def eye(self) -> Array:
        return self.look + self.distance * self.back

    def matrix(self, width: int, height: int) -> Array:
        """Return the matrix (4, 4) from the world to GL's clip space for a picture's size."""
        right = np.array([-np.sin(self.azimuth), np.cos(self.azimuth), 0.0])
        axes = np.stack([right, np.cross(self.back, right), self.back])
        view = np.eye(4)
        view[:3, :3], view[:3, 3] = axes, -axes @ self.eye
        lens = LENS * min(1.0, width / height)
        deep = np.array([NEAR + FAR, 2 * NEAR * FAR]) / (NEAR - FAR)
        project = np.zeros((4, 4))
        project[0, 0], project[1, 1] = lens * height / width, lens
        project[2, 2:], project[3, 2] = deep, -1.0
        return np.asarray(project @ view, dtype=np.float32)

    def frame(self, points: Array, width: int, height: int) -> tuple[int, int, int, int]:
        """Return the part (x, y, width, height) of a picture that shows points (n, 3), in pixels.

        A point behind the eye projects nowhere; the whole picture is returned then.
        """
        clip = np.column_stack([points, np.ones(len(points))]) @ self.matrix(width, height).T
        if clip[:, 3].min() <= NEAR:
            return 0, 0, width, height
        at = (clip[:, :2] / clip[:, 3:] + 1) / 2 * [width, height]
        low = np.clip(np.floor(at.min(axis=0)) - EDGE, 0, [width - 1, height - 1]).astype(int)
        high = np.clip(np.ceil(at.max(axis=0)) + EDGE, low + 1, [width, height]).astype(int)
        return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


SUN = np.array([-0.35, 0.45, -1.0])
BOX = np.array(list(product((-1.05, 1.05), repeat=3)))  # around a ball


@dataclass(frozen=True)
class Drawn:
    """One ball in one picture; lengths in radii.

    colour   of its shell
    stands   a (4, 4) matrix for each body
    blurred  for each body 0, where its marks are seen, to 1, where it turns too fast for them
    opacity  1, or less for a ghost
    """

    colour: str
    stands: Mapping[str, Array]
    blurred: Mapping[str, float]
    opacity: float = 1.0


@dataclass(frozen=True)
class Line:
    """The first `count` corners of a path's strip, which `Canvas.keep` has by that name."""

    strip: str
    count: int
    colour: str
    opacity: float = 1.0


@dataclass(frozen=True)
class Loose:
    """Triangles (n, 6) in the world's axes, for shapes that change from frame to frame."""

    corners: Array
    colour: str


@dataclass(frozen=True)
class Pane:
    """One picture: balls, lines and loose shapes under a camera."""

    camera: Camera
    balls: Sequence[Drawn]
    lines: Sequence[Line] = ()
    loose: Sequence[Loose] = ()


def around(pane: Pane) -> Array:
    """Return points (n, 3) whose hull holds the balls, their shadows and the loose shapes."""
    around = []
    for ball in pane.balls:
        corners = BOX + ball.stands["shell"][:3, 3]
        around += [corners, corners - SUN * (corners[:, 2:] / SUN[2])]
    return np.concatenate([*around, *(each.corners[:, :3] for each in pane.loose)])


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
    """An off-screen OpenGL that draws pictures of balls with the same shapes.

    size: (height, width) in pixels; backend: as `gl.find_backend` returned. Raises OSError if
    there is no off-screen GL. Call `close` when done.
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
        from OpenGL.raw.GL.VERSION.GL_2_0 import glVertexAttribPointer

        self._gl: Any = GL
        # PyOpenGL's own wrapper keeps every pointer under the context's handle, which OSMesa
        # makes anew for each call: a film's memory would grow with its frames.
        self._point_at: Any = glVertexAttribPointer
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
        """Copy the corners (n, 6) of triangles, or of a strip, to OpenGL under a name."""
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
        """Draw the panes side by side, equally wide, and return the pixels (height, width, 3)."""
        GL = self._gl
        self._context.make_current()
        width = self.width // len(panes)
        lefts = [width * i for i in range(len(panes))]
        # The whole floor is drawn with one sample a pixel; the balls' surroundings then replace it.
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
        """Draw the floor, shadows and paths; the first line lies over the others."""
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
        # The stencil counts how often a pixel was darkened: by glass once, by a solid once more.
        for level, glass in ((0, True), (1, False)):
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
        # Clear surfaces are not sorted: the far sides of all are drawn before the near ones.
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
        """Draw the triangles kept under a name, or the first `count` corners of a strip."""
        GL = self._gl
        corners, order, whole = self._kept[name]
        GL.glUniform1i(self._at["kind"], int(kind))
        GL.glUniformMatrix4fv(self._at["place"], 1, True, place.astype(np.float32))
        GL.glUniform4f(self._at["colour"], *map(float, rgba))
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, corners)
        for index in (0, 1):
            GL.glEnableVertexAttribArray(index)
            self._point_at(index, 3, GL.GL_FLOAT, False, 24, c_void_p(12 * index))
        if count is not None:
            GL.glDrawArrays(GL.GL_TRIANGLE_STRIP, 0, count)
            return
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, order)
        GL.glDrawElements(GL.GL_TRIANGLES, whole, GL.GL_UNSIGNED_INT, None)

    def close(self) -> None:
        """Free the OpenGL context and all that it holds."""
        self._context.free()
