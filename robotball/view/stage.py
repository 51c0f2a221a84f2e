"""Draw balls, paths, arrows and shadows on a floor with MuJoCo's renderer.

A stage is a MuJoCo model of the floor and of balls, whose bodies are mocap bodies. Three things are
added to MuJoCo's scene for each picture:

* A soft shadow. The ball is drawn in white from the sun's direction; that picture, blurred, becomes
  the opacity of a black plane on the floor. MuJoCo's shadow maps would double the time for a
  picture, and glass would have an opaque shadow.
* The path: a strip whose corners after the present time coincide with the present corners. *
Arrows.

Lengths are in radii of the ball.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import mujoco
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from robotball.robot import looks as palette
from robotball.robot.ball import PARTS
from robotball.robot.looks import BLUR, MARKS, Looks, add_materials
from robotball.robot.shapes import add_geoms
from robotball.rotations import Array, from_matrix, rotation_matrix, turned
from robotball.view import gl
from robotball.view.tracks import SLIPS

Pixels = NDArray[np.uint8]
Arrow = tuple[Array, Array, str]  # start (3,), end (3,) and colour
Projection = tuple[float, float, float]  # x and y of a point in a picture, and the ball radius [px]
_Stands = Mapping[str, tuple[Array, Array]]

_HIDDEN = "3"  # geom group that is hidden by default
_OWN = ("shell", "mark")  # materials that have the engine's colour
LENS = 3.1  # distance at which the picture's shorter side is 2, a lens of 36 degrees
_NEAR = 7.2  # distance for which the widths and lifts below are valid; they scale with the distance
_TRAIL = 0.04  # half of a path's width
_LIFT = 0.002  # height of the shadows, then of the paths, to separate them in the depth buffer
_BEHIND = 0.003  # a ghost is drawn farther away, to prevent flicker with the ball's surfaces
_THICK = 0.06  # half of an arrow's width
POINTS = 20_000  # of a path; longer paths are thinned, because each picture uploads all points
_ADDED = 100  # capacity for geoms that a picture adds
_SAMPLES = 4  # per pixel
_NEAREST, _FAR = 0.015, 40.0  # clipping distances, divided by the camera's distance
_SKY = (0.95, 0.96, 0.97)
_TEXELS = 128  # along each side of a shadow's texture
_REACH = 1.25  # half of the shadow's side, including the blur
SUN = np.array([-0.3, 0.4, -1.0])  # the direction of the sun's light, as in mjcf/floor.xml
_PENUMBRA = 1.5  # texels, standard deviation of the blur
_SHADE = 0.34  # darkness of an opaque shadow; it scales with √opacity, so that glass has one, too
_OPAQUE = 0.99  # below 0.995, the limit under which MuJoCo blends a geom with its texture's opacity


def build_stage(looks: Looks, colours: Sequence[str], opacities: Sequence[float]) -> mujoco.MjSpec:
    """Return a model of the floor and one ball per colour and opacity; lengths in radii.

    Mocap bodies are in the order of `looks`, first for the first ball, then for the next.
    Bodies and materials are prefixed with their ball: "ball0_shell", "ball1_rotor1".
    """
    root = ElementTree.parse(PARTS / "floor.xml").getroot()
    assets, world = root.find("asset"), root.find("worldbody")
    assert assets is not None
    assert world is not None
    for number, (colour, opacity) in enumerate(zip(colours, opacities, strict=True)):
        prefix, rgb = f"ball{number}_", " ".join(f"{part:g}" for part in palette.rgb(colour))
        add_materials(assets, looks, dict.fromkeys(_OWN, rgb), prefix, opacity)
        for name, shapes in looks.items():
            body = SubElement(world, "body", name=f"{prefix}{name}", mocap="true")
            add_geoms(assets, body, shapes, prefix=prefix)
            for disc in body.iterfind(f"geom[@material='{prefix}{BLUR}']"):
                disc.set("group", _HIDDEN)
    return mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))


def pose(
    model: mujoco.MjModel, data: mujoco.MjData, names: Collection[str], stands: Sequence[_Stands]
) -> None:
    """Place the named bodies of each ball at the poses that `Track.stands` returns for a time.

    Calls only the two parts of MuJoCo's forward dynamics that rendering needs.
    """
    bodies = [ball[name] for ball in stands for name in names]
    data.mocap_pos[:] = np.array([shift[0] for _, shift in bodies])
    data.mocap_quat[:] = from_matrix(np.array([turn[0] for turn, _ in bodies]))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def smoothed(values: Array, deviation: float, beyond: Literal["constant", "edge"]) -> Array:
    """Return the means of values (n, ...) along their first axis with the weights of a Gaussian.

    deviation: the standard deviation in rows. beyond: the values outside are 0 ("constant"), or
    equal the end values ("edge").
    """
    reach = int(4 * deviation + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    padded = np.pad(values, [(reach, reach), *[(0, 0)] * (values.ndim - 1)], beyond)
    return sliding_window_view(padded, len(weights), axis=0) @ (weights / weights.sum())


@dataclass(frozen=True)
class Camera:
    """A view of the point `look` (3,) from a distance, azimuth and elevation [rad]."""

    look: Array
    distance: float
    azimuth: float
    elevation: float

    @property
    def eye(self) -> Array:
        """Position (3,) of the camera."""
        level = np.cos(self.elevation)
        back = [level * np.cos(self.azimuth), level * np.sin(self.azimuth), np.sin(self.elevation)]
        return self.look + self.distance * np.array(back)

    def project(self, point: Array, size: tuple[int, int]) -> Projection:
        """Return the position of a point (3,) in a picture of (height, width) pixels."""
        right, up, back = _facing(self.eye - self.look) @ (point - self.eye)
        radius = LENS * min(size) / 2 / -back
        return size[1] / 2 + radius * right, size[0] / 2 - radius * up, radius


class Stage:
    """An off-screen OpenGL context with a floor and balls of the same shapes.

    size: (height, width) of a picture [px]. colours: one for each ball. paths: contact points (n,
    2) of each ball. distance: largest distance of the camera; fog begins beyond it. backend: from
    `gl.find_backend`. slips (n,): the points at which the last path has a band. Call `close` when
    done.
    """

    def __init__(
        self,
        size: tuple[int, int],
        looks: Looks,
        colours: Sequence[str],
        paths: Sequence[Array],
        distance: float,
        backend: str,
        slips: NDArray[np.bool_] | None = None,
    ) -> None:
        self._size, self._bodies = size, list(looks)
        self._paths, self._step = [*paths], -(-len(paths[0]) // POINTS)
        self._strips = [_TRAIL * _strip(path[:: self._step]) for path in paths]
        self._strips[-1] *= 2  # to be visible below the others
        self._trails = [*colours]
        if slips is not None and slips.any():
            self._paths.append(paths[-1])
            self._strips.append(2 * self._strips[-1] * np.repeat(slips[:: self._step], 2)[:, None])
            self._trails.append(SLIPS.colour)
        spec = build_stage(looks, colours, np.ones(len(colours)).tolist())
        for i, strip in enumerate(self._strips):
            _add_strip(spec, f"path{i}", len(strip))
            _add_shadow_texture(spec, f"shadow{i}")
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        visual, height, width = model.vis, *size
        visual.global_.fovy = np.degrees(2 * np.arctan(max(1.0, height / width) / LENS))
        model.stat.extent = 1.0  # unit of the lengths below
        visual.rgba.fog = *_SKY, 1.0
        visual.map.fogstart, visual.map.fogend = 1.2 * distance, distance + 38.0
        visual.map.zfar = _FAR * distance  # extent of the infinite floor
        for i in range(model.nmesh):  # the strips are lit from above, like the floor
            if model.mesh(i).name.startswith("path"):
                begin, count = model.mesh_normaladr[i], model.mesh_normalnum[i]
                model.mesh_normal[begin : begin + count] = 0.0, 0.0, 1.0
        names = [model.mat(i).name.split("_") for i in model.geom_matid]
        self._ball = np.array([int(name[0][4:]) if len(name) > 1 else -1 for name in names])
        self._material = np.array([name[-1] for name in names])
        self._mine = self._ball >= 0
        # A geom's colour overrides its material's, so opacities can be changed per geom.
        model.geom_rgba[self._mine] = model.mat_rgba[model.geom_matid[self._mine]]
        self._opacity = self._seen = model.geom_rgba[:, 3].copy()
        self._centres = np.zeros((len(colours), 3))
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 1  # including the discs of fast rotors, which viewers hide
        self._context = gl.context(width, height, backend)
        self._scene = mujoco.MjvScene(model, model.ngeom + _ADDED)
        # A separate small buffer for shadows saves a seventh of the time per picture: reading takes
        # time in proportion to the buffer, and a blurred picture needs no multisampling.
        self._shading = self._buffer(_TEXELS, _TEXELS, 0)
        self._drawing = self._buffer(height, width, _SAMPLES)

    def place(
        self, stands: Sequence[_Stands], blurred: Sequence[Mapping[str, float]], turn: float = 0.0
    ) -> None:
        """Place the named bodies of each ball.

        blurred: for each body, from 0 (marks visible) to 1 (rotation too fast for marks). turn: the
        floor's angle about the world's Z [rad].
        """
        model = self._model
        pose(model, self._data, self._bodies, stands)
        floor = turned(np.eye(4)[0], np.array([0.0, 0.0, turn]))
        self._data.geom("floor").xmat = rotation_matrix(floor).ravel()
        self._centres = np.array([ball["shell"][1][0] for ball in stands])
        self._seen = self._opacity.copy()
        for i, fasts in enumerate(blurred):
            for name, fast in fasts.items():
                body = model.geom_bodyid == model.body(f"ball{i}_{name}").id
                self._seen[body & (self._material == MARKS)] *= 1 - fast
                self._seen[body & (self._material == BLUR)] *= fast
        for i in range(len(stands)):
            self._shade(i)

    def draw(
        self,
        camera: Camera,
        opacities: Sequence[float],
        trails: Sequence[float],
        last: int,
        arrows: Sequence[Arrow] = (),
    ) -> Pixels:
        """Return a picture (height, width, 3).

        opacities: one for each ball, 0 to omit the ball. trails: opacities of the paths, which end
        at point number `last`.
        """
        self._update(camera, opacities)
        # The band has the opacity of the last path.
        for i, opacity in enumerate([*trails, trails[-1]][: len(self._paths)]):
            self._add_path(i, last, opacity, camera.distance / _NEAR)
        for i, opacity in enumerate(opacities):
            if opacity > 0:
                self._add_shadow(i, opacity, camera)
        for begin, end, colour in arrows:
            geom = self._add(mujoco.mjtGeom.mjGEOM_ARROW, colour, 1.0)
            # mjv_connector draws an arrow of half the length.
            mujoco.mjv_connector(geom, geom.type, _THICK, begin, 2 * end - begin)
        return self._render(self._drawing, self._size, fog=True)

    def close(self) -> None:
        """Free the OpenGL context and all its resources."""
        self._drawing.free()
        self._shading.free()
        self._context.free()

    def _update(self, camera: Camera, opacities: Sequence[float]) -> None:
        model, data = self._model, self._data
        view = mujoco.MjvCamera()
        view.lookat[:], view.distance = camera.look, camera.distance
        view.azimuth, view.elevation = np.degrees([camera.azimuth + np.pi, -camera.elevation])
        # Proportional to the distance, so that the depth buffer separates layers on the floor.
        model.vis.map.znear = _NEAREST * camera.distance
        model.vis.map.zfar = _FAR * camera.distance
        balls = self._ball[self._mine]
        opacity = self._seen[self._mine] * np.array(opacities)[balls]
        model.geom_rgba[self._mine, 3] = _once(opacity)
        away = (camera.look - camera.eye) / camera.distance
        stand = data.geom_xpos.copy()
        data.geom_xpos[self._mine] += _BEHIND * np.outer(balls, away)
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, self._option, None, view, every, self._scene)
        data.geom_xpos[:] = stand

    def _buffer(self, height: int, width: int, samples: int) -> mujoco.MjrContext:
        """Return a buffer for pictures of a size [px] with multisampling."""
        visual = self._model.vis
        visual.global_.offheight, visual.global_.offwidth = height, width
        visual.quality.offsamples = samples
        return mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)

    def _render(self, buffer: mujoco.MjrContext, size: tuple[int, int], *, fog: bool) -> Pixels:
        flags, flag = self._scene.flags, mujoco.mjtRndFlag
        flags[flag.mjRND_FOG] = flags[flag.mjRND_SKYBOX] = fog
        # MuJoCo's haze and reflections would show a horizon that the fog hides.
        flags[flag.mjRND_SHADOW] = flags[flag.mjRND_HAZE] = flags[flag.mjRND_REFLECTION] = False
        self._context.make_current()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, buffer)
        rectangle = mujoco.MjrRect(0, 0, size[1], size[0])
        mujoco.mjr_render(rectangle, self._scene, buffer)
        pixels = np.empty((*size, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, rectangle, buffer)
        return pixels[::-1]  # OpenGL's rows run upwards

    def _add(self, kind: int, colour: str, opacity: float, material: str = "") -> Any:
        """Add a geom of size one at the origin to the scene, and return it."""
        scene = self._scene
        geom = scene.geoms[scene.ngeom]
        scene.ngeom += 1
        rgba = np.array([*palette.rgb(colour), opacity])
        mujoco.mjv_initGeom(geom, kind, np.ones(3), np.zeros(3), np.eye(3).ravel(), rgba)
        if material:
            geom.matid = self._model.mat(material).id
        return geom

    def _shade(self, i: int) -> None:
        """Draw a ball in white from the sun's direction, as the texture of its shadow."""
        centre, sun = self._centres[i], SUN / np.linalg.norm(SUN)
        self._update(Camera(centre, _NEAR, 0.0, 1.0), np.eye(len(self._centres))[i].tolist())
        for camera in self._scene.camera:  # a stereo pair; MuJoCo uses the mean of the two
            camera.pos, camera.forward, camera.up = centre - _NEAR * sun, sun, _facing(-SUN)[1]
            camera.orthographic, camera.frustum_center, camera.frustum_width = 1, 0.0, _REACH
            camera.frustum_bottom, camera.frustum_top = -_REACH, _REACH
        for geom in self._scene.geoms[: self._scene.ngeom]:
            geom.rgba[:3], geom.emission, geom.matid = 1.0, 1.0, -1
            if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
                geom.rgba[3] = 0.0  # the floor is not part of the ball
        # A texture's rows run upwards, a picture's downwards.
        opacity = self._render(self._shading, (_TEXELS, _TEXELS), fog=False)[::-1, :, 0] / 255
        for _ in range(2):  # along the columns, then along the rows
            opacity = smoothed(opacity, _PENUMBRA, "constant").T
        dark = _SHADE * np.sqrt(opacity)
        texture = self._model.tex(f"shadow{i}")
        texels = self._model.tex_data[texture.adr[0] :][: 4 * _TEXELS**2]
        texels[3::4] = np.round(255 * _once(dark)).ravel()
        mujoco.mjr_uploadTexture(self._model, self._drawing, texture.id)

    def _add_shadow(self, i: int, opacity: float, camera: Camera) -> None:
        shadow = self._add(mujoco.mjtGeom.mjGEOM_PLANE, "#000000", _OPAQUE * opacity, f"shadow{i}")
        height = float(self._centres[i, 2])
        shadow.pos = self._centres[i] - SUN * (height / SUN[2])
        shadow.pos[2] = _LIFT * camera.distance / _NEAR
        # The plane's sides are the vectors on the floor that point right and up if seen from the
        # sun.
        shadow.mat[:2, :2] = np.linalg.inv(_facing(-SUN)[:2, :2])
        shadow.size, shadow.specular = np.array([_REACH, _REACH, 1.0]), 0.0

    def _add_path(self, i: int, last: int, opacity: float, scale: float) -> None:
        """Add a path up to its point `last`; its width and height are multiplied by `scale`."""
        model, below = self._model, len(self._paths) - 1 - i
        strip = scale * self._strips[i]
        strip[:, :2] += np.repeat(self._paths[i][:: self._step], 2, axis=0)
        # MuJoCo draws the whole mesh: triangles after the present time have zero area.
        end = 2 * (last // self._step) + 2
        strip[end:, :2] = self._paths[i][last]  # a thinned path must still reach the ball
        strip[:, 2] = _LIFT * (2 + below) * scale
        mesh = model.mesh(f"path{i}")
        model.mesh_vert[mesh.vertadr[0] :][: len(strip)] = strip
        self._context.make_current()
        mujoco.mjr_uploadMesh(model, self._drawing, mesh.id)
        path = self._add(mujoco.mjtGeom.mjGEOM_MESH, self._trails[i], float(_once(opacity)))
        path.dataid = 2 * mesh.id  # doubled, because MuJoCo stores each mesh and its convex hull
        path.specular = 0.0


def _once(opacity: Array | float) -> Array:
    """Return the opacity for MuJoCo, which blends transparent geoms twice."""
    return np.asarray(1 - np.sqrt(1 - opacity))


def _facing(back: Array) -> Array:
    """Return unit vectors (3, 3) right, up and back; `back` (3,) must not be vertical."""
    right = np.cross([0.0, 0.0, 1.0], back)
    axes = np.stack([right, np.cross(back, right), back])
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def _add_shadow_texture(spec: mujoco.MjSpec, name: str) -> None:
    """Add a material with a transparent black texture, whose opacity is set for each picture."""
    texture = spec.add_texture(
        name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=_TEXELS, height=_TEXELS, nchannel=4
    )
    texture.data = bytes(4 * _TEXELS**2)
    spec.add_material(name=name).textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _add_strip(spec: mujoco.MjSpec, name: str, corners: int) -> None:
    """Add a mesh of a strip's triangles; the corners are set for each picture."""
    anywhere = np.zeros((corners, 3))
    anywhere[:, 0], anywhere[1::2, 1] = np.arange(corners), 1.0
    first = np.arange(corners - 2)
    odd = first % 2  # every second triangle of a strip has the opposite orientation
    faces = np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
    spec.add_mesh(
        name=name,
        uservert=anywhere.ravel(),
        userface=faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )


def _strip(points: Array) -> Array:
    """Return vectors (2 n, 3) from points (n, 2) to both sides of a path, on the floor."""
    steps = np.gradient(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    along = np.divide(steps, lengths, out=np.tile([1.0, 0.0], (len(points), 1)), where=lengths > 0)
    strip = np.zeros((2 * len(points), 3))
    strip[0::2, 0], strip[0::2, 1] = -along[:, 1], along[:, 0]
    strip[1::2] = -strip[0::2]
    return strip
