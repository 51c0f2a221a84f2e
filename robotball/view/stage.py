"""Draw balls, paths, arrows and shadows on a floor by MuJoCo's renderer.

A stage is a MuJoCo model of the floor and of balls, whose bodies are placed by hand; its geoms are
drawn as they are in the model. Four things are added to MuJoCo's scene for each picture:

* A soft shadow. The ball is drawn in white as the sun sees it; that picture, blurred, is the
  opacity of a black plane on the floor. Shadow maps take as long again as the picture itself, and
  by them the glass of a shell throws an opaque shadow.
* The rim of the glass, which reflects more at a grazing angle: a picture of it (Schlick's
  approximation of Fresnel's law) faces the camera in the plane of the shell's outline.
* The path, a strip whose corners after the present time all lie on the present ones.
* Arrows.

Lengths are in radii of the ball.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from robotball.robot import looks as palette
from robotball.robot.ball import PARTS
from robotball.robot.looks import BLUR, MARKS, Looks, add_materials
from robotball.robot.shapes import add_geoms
from robotball.rotations import Array
from robotball.view import gl

Pixels = NDArray[np.uint8]
Arrow = tuple[Array, Array, str]  # from a point (3,) to another, and its colour
Seen = tuple[float, float, float]  # x and y of a point in a picture, and a radius there [px]
_Stands = Mapping[str, tuple[Array, Array]]

_HIDDEN = "3"  # the group of what is hidden until a picture asks for it
_OWN = ("shell", "mark")  # the materials that have the engine's colour


def build_stage(looks: Looks, colours: Sequence[str], opacities: Sequence[float]) -> mujoco.MjSpec:
    """Return the model of the floor and a ball of each colour and opacity; lengths in radii.

    Its mocap bodies are the first ball's in the order of `looks`, then the next one's. A body and a
    material are named after their ball: "ball0_shell", "ball1_rotor1".
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
    """Place the named bodies of each ball, by what `Track.stands` returns of one time.

    By hand, so that of MuJoCo's forward dynamics only two parts are needed.
    """
    bodies = [each[name] for each in stands for name in names]
    data.mocap_pos[:] = np.array([shift[0] for _, shift in bodies])
    turns = Rotation.from_matrix(np.array([turn[0] for turn, _ in bodies]))
    data.mocap_quat[:] = turns.as_quat(scalar_first=True)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


@dataclass(frozen=True)
class Camera:
    """A view of a point (3,) from a distance, azimuth and elevation [rad]."""

    look: Array
    distance: float
    azimuth: float
    elevation: float

    @property
    def eye(self) -> Array:
        """The camera's own place (3,)."""
        level = np.cos(self.elevation)
        back = [level * np.cos(self.azimuth), level * np.sin(self.azimuth), np.sin(self.elevation)]
        return self.look + self.distance * np.array(back)

    def seen(self, point: Array, size: tuple[int, int]) -> Seen:
        """Return where a point (3,) is in a picture of that size (height, width) in pixels."""
        right, up, back = _facing(self.eye - self.look) @ (point - self.eye)
        radius = LENS * min(size) / 2 / -back
        return size[1] / 2 + radius * right, size[0] / 2 - radius * up, radius


LENS = 3.1  # a lens of 36 degrees: the distance at which the picture's shorter side is 2
_NEAR = 7.2  # the distance from which widths and lifts are as given below; they grow with it
_TRAIL = 0.04  # half of a path's width; the last is wider, to be seen below the others
_LIFT = 0.002  # between shadows, the last path, …, the first: the depth buffer must separate them
_BEHIND = 0.003  # a ghost is drawn farther away, or its surfaces would flicker through the ball's
_THICK = 0.06  # half of an arrow's width
POINTS = 20_000  # of a path; a longer one is thinned, as all are sent to OpenGL for each picture
_ADDED = 100  # room for the geoms that a picture adds
_SAMPLES = 4  # a pixel
_NEAREST, _FAR = 0.015, 40.0  # what is seen, in distances of the camera from what it looks at
_SKY = (0.95, 0.96, 0.97)

_TEXELS = 128  # along each side of the pictures of shadow and rim
_REACH = 1.25  # half of the shadow's side: the ball, and room for the blur
SUN = np.array([-0.3, 0.4, -1.0])  # the direction of its light, as in mjcf/floor.xml
_PENUMBRA = 1.5  # texels: the standard deviation of the blur
# How dark the shadow of a solid is; it goes as the root of the opacity, for glass to have one too.
_SHADE = 0.34
_RIM = 0.6  # how much the glass reflects where it is seen edge-on
_OPAQUE = 0.99  # MuJoCo blends a geom with its texture's opacity if its own is less than 0.995


class Stage:
    """An off-screen OpenGL with a floor and balls of the same shapes.

    size: (height, width) of a picture in pixels; colours: of each ball; paths: the contact points
    (n, 2) of each; distance: the camera's largest, beyond which the fog begins; backend: as
    `gl.find_backend` returned. Call `close` when done.
    """

    def __init__(
        self,
        size: tuple[int, int],
        looks: Looks,
        colours: Sequence[str],
        paths: Sequence[Array],
        distance: float,
        backend: str,
    ) -> None:
        self._size, self._bodies, self._colours = size, list(looks), colours
        self._paths, self._step = paths, -(-len(paths[0]) // POINTS)
        self._strips = [_strip(path[:: self._step]) for path in paths]
        spec = build_stage(looks, colours, np.ones(len(colours)).tolist())
        for i, strip in enumerate(self._strips):
            _add_strip(spec, f"path{i}", len(strip))
            _add_texture(spec, f"shadow{i}", np.zeros((_TEXELS, _TEXELS)), 0)
        _add_texture(spec, "rim", _rim(), 255)
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        visual, height, width = model.vis, *size
        visual.global_.fovy = np.degrees(2 * np.arctan(max(1.0, height / width) / LENS))
        model.stat.extent = 1.0  # MuJoCo's unit of the lengths below
        visual.rgba.fog = *_SKY, 1.0
        visual.map.fogstart, visual.map.fogend = 1.2 * distance, distance + 38.0
        visual.map.zfar = _FAR * distance  # as far as MuJoCo makes a plane without an end
        for i in range(model.nmesh):  # the strips, like the floor, are lit from above
            if model.mesh(i).name.startswith("path"):
                begin, count = model.mesh_normaladr[i], model.mesh_normalnum[i]
                model.mesh_normal[begin : begin + count] = 0.0, 0.0, 1.0
        names = [model.mat(i).name.split("_") for i in model.geom_matid]
        self._ball = np.array([int(name[0][4:]) if len(name) > 1 else -1 for name in names])
        self._material = np.array([name[-1] for name in names])
        self._mine = self._ball >= 0
        # A geom's own colour overrides its material's: opacities then change geom by geom.
        model.geom_rgba[self._mine] = model.mat_rgba[model.geom_matid[self._mine]]
        self._opacity = self._seen = model.geom_rgba[:, 3].copy()
        self._centres = np.zeros((len(colours), 3))
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 1  # the discs of fast rotors too, which viewers hide
        self._context = gl.context(width, height, backend)
        self._scene = mujoco.MjvScene(model, model.ngeom + _ADDED)
        # Shadows have a buffer of their own, which saves a seventh of a frame: a picture is read in
        # the time that its whole buffer takes, and a blurred one needs no samples.
        self._shading = self._buffer(_TEXELS, _TEXELS, 0)
        self._drawing = self._buffer(height, width, _SAMPLES)

    def place(self, stands: Sequence[_Stands], blurred: Sequence[Mapping[str, float]]) -> None:
        """Place each ball's bodies, by their names.

        blurred: for each body 0, where its marks are seen, to 1, where it turns too fast for them.
        """
        model = self._model
        pose(model, self._data, self._bodies, stands)
        self._centres = np.array([each["shell"][1][0] for each in stands])
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

        opacities: of each ball, 0 for one that is not drawn; trails: of each path, which ends at
        its point `last`.
        """
        self._update(camera, opacities)
        for i, opacity in enumerate(trails):
            self._add_path(i, last, opacity, camera.distance / _NEAR)
        for i, opacity in enumerate(opacities):
            if opacity > 0:
                self._add_shadow(i, opacity, camera)
                self._add_rim(i, opacity, camera)
        for begin, end, colour in arrows:
            geom = self._add(mujoco.mjtGeom.mjGEOM_ARROW, colour, 1.0)
            # MuJoCo's arrows end half way.
            mujoco.mjv_connector(geom, geom.type, _THICK, begin, 2 * end - begin)
        return self._render(self._drawing, self._size, fog=True)

    def close(self) -> None:
        """Free the OpenGL context and all that it holds."""
        self._drawing.free()
        self._shading.free()
        self._context.free()

    def _update(self, camera: Camera, opacities: Sequence[float]) -> None:
        """Fill the scene with the model's geoms."""
        model, data = self._model, self._data
        view = mujoco.MjvCamera()
        view.lookat[:], view.distance = camera.look, camera.distance
        view.azimuth, view.elevation = np.degrees([camera.azimuth + np.pi, -camera.elevation])
        # In proportion, for the depth buffer to separate what lies on the floor from far away too.
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
        """Return a buffer for pictures of a size in pixels, with so many samples a pixel."""
        visual = self._model.vis
        visual.global_.offheight, visual.global_.offwidth = height, width
        visual.quality.offsamples = samples
        return mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)

    def _render(self, buffer: mujoco.MjrContext, size: tuple[int, int], *, fog: bool) -> Pixels:
        flags, flag = self._scene.flags, mujoco.mjtRndFlag
        flags[flag.mjRND_FOG] = flags[flag.mjRND_SKYBOX] = fog
        # MuJoCo's haze and reflections show a horizon that the fog hides.
        flags[flag.mjRND_SHADOW] = flags[flag.mjRND_HAZE] = flags[flag.mjRND_REFLECTION] = False
        self._context.make_current()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, buffer)
        rectangle = mujoco.MjrRect(0, 0, size[1], size[0])
        mujoco.mjr_render(rectangle, self._scene, buffer)
        pixels = np.empty((*size, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, rectangle, buffer)
        return pixels[::-1]  # OpenGL's rows run upwards

    def _add(self, kind: int, colour: str, opacity: float, material: str = "") -> Any:
        """Return a geom that is added to the scene, at the origin and of size one."""
        scene = self._scene
        geom = scene.geoms[scene.ngeom]
        scene.ngeom += 1
        rgba = np.array([*palette.rgb(colour), opacity])
        mujoco.mjv_initGeom(geom, kind, np.ones(3), np.zeros(3), np.eye(3).ravel(), rgba)
        if material:
            geom.matid = self._model.mat(material).id
        return geom

    def _shade(self, i: int) -> None:
        """Draw a ball in white as the sun sees it, which becomes the texture of its shadow."""
        centre, sun = self._centres[i], SUN / np.linalg.norm(SUN)
        self._update(Camera(centre, _NEAR, 0.0, 1.0), np.eye(len(self._centres))[i].tolist())
        for camera in self._scene.camera:  # two, for stereo: MuJoCo takes the mean of both
            camera.pos, camera.forward, camera.up = centre - _NEAR * sun, sun, _facing(-SUN)[1]
            camera.orthographic, camera.frustum_center, camera.frustum_width = 1, 0.0, _REACH
            camera.frustum_bottom, camera.frustum_top = -_REACH, _REACH
        for geom in self._scene.geoms[: self._scene.ngeom]:
            geom.rgba[:3], geom.emission, geom.matid = 1.0, 1.0, -1
            if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
                geom.rgba[3] = 0.0  # the floor is not part of the ball
        # A texture's rows run upwards, a picture's downwards.
        opacity = self._render(self._shading, (_TEXELS, _TEXELS), fog=False)[::-1, :, 0] / 255
        dark = _SHADE * np.sqrt(gaussian_filter(opacity, _PENUMBRA, mode="constant"))
        texture = self._model.tex(f"shadow{i}")
        texels = self._model.tex_data[texture.adr[0] :][: 4 * _TEXELS**2]
        texels[3::4] = np.round(255 * _once(dark)).ravel()
        mujoco.mjr_uploadTexture(self._model, self._drawing, texture.id)

    def _add_shadow(self, i: int, opacity: float, camera: Camera) -> None:
        shadow = self._add(mujoco.mjtGeom.mjGEOM_PLANE, "#000000", _OPAQUE * opacity, f"shadow{i}")
        height = float(self._centres[i, 2])
        shadow.pos = self._centres[i] - SUN * (height / SUN[2])
        shadow.pos[2] = _LIFT * camera.distance / _NEAR
        # The plane's sides are those vectors on the floor that the sun sees as its right and up.
        shadow.mat[:2, :2] = np.linalg.inv(_facing(-SUN)[:2, :2])
        shadow.size, shadow.specular = np.array([_REACH, _REACH, 1.0]), 0.0

    def _add_rim(self, i: int, opacity: float, camera: Camera) -> None:
        rim = self._add(mujoco.mjtGeom.mjGEOM_PLANE, self._colours[i], _OPAQUE * opacity, "rim")
        to_eye = camera.eye - self._centres[i]
        distance = float(np.linalg.norm(to_eye))
        # The outline of a sphere is a circle of its own, nearer to the eye than the centre.
        rim.pos = self._centres[i] + to_eye / distance**2
        rim.mat = _facing(to_eye).T
        outline = np.sqrt(1 - 1 / distance**2)
        rim.size = np.array([outline, outline, 1.0])

    def _add_path(self, i: int, last: int, opacity: float, scale: float) -> None:
        """Add a path up to its point `last`, as wide and as high over the floor as `scale` says."""
        model, below = self._model, len(self._paths) - 1 - i
        strip = _TRAIL * (1 if below else 2) * scale * self._strips[i]
        strip[:, :2] += np.repeat(self._paths[i][:: self._step], 2, axis=0)
        # MuJoCo draws a mesh whole: triangles after the present have no area.
        end = 2 * (last // self._step) + 2
        strip[end:, :2] = self._paths[i][last]  # a thinned path too reaches the ball
        strip[:, 2] = _LIFT * (2 + below) * scale
        mesh = model.mesh(f"path{i}")
        model.mesh_vert[mesh.vertadr[0] :][: len(strip)] = strip
        self._context.make_current()
        mujoco.mjr_uploadMesh(model, self._drawing, mesh.id)
        path = self._add(mujoco.mjtGeom.mjGEOM_MESH, self._colours[i], float(_once(opacity)))
        path.dataid = 2 * mesh.id  # twice, as MuJoCo keeps a mesh and its hull
        path.specular = 0.0


def _once(opacity: Array | float) -> Array:
    """Return the opacity to give to MuJoCo for one that is to be seen.

    It blends what is not opaque twice, from front to back and from back to front.
    """
    return np.asarray(1 - np.sqrt(1 - opacity))


def _facing(back: Array) -> Array:
    """Return the unit vectors (3, 3) to the right, up and back of a camera that looks against it.

    `back` (3,) may not be vertical.
    """
    right = np.cross([0.0, 0.0, 1.0], back)
    axes = np.stack([right, np.cross(back, right), back])
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def _rim() -> Array:
    """Return the opacity (n, n) that glass has at its rim, seen from the front."""
    at = np.linspace(-1.0, 1.0, _TEXELS)
    out = np.hypot(at, at[:, None])
    cosine = np.sqrt(np.maximum(1 - out**2, 0.0))
    return _once(_RIM * (1 - cosine) ** 3) * np.clip((1 - out) * _TEXELS / 2, 0.0, 1.0)


def _add_texture(spec: mujoco.MjSpec, name: str, opacity: Array, grey: int) -> None:
    """Add a material and its texture (n, n), of one grey and an opacity from 0 to 1."""
    texels = np.full((*opacity.shape, 4), grey, np.uint8)
    texels[:, :, 3] = np.round(255 * opacity)
    texture = spec.add_texture(
        name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=_TEXELS, height=_TEXELS, nchannel=4
    )
    texture.data = texels.tobytes()
    spec.add_material(name=name).textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _add_strip(spec: mujoco.MjSpec, name: str, corners: int) -> None:
    """Add a mesh with the triangles of a strip, whose corners are set for each picture."""
    anywhere = np.zeros((corners, 3))
    anywhere[:, 0], anywhere[1::2, 1] = np.arange(corners), 1.0
    first = np.arange(corners - 2)
    odd = first % 2  # every second triangle of a strip runs the other way round
    faces = np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
    spec.add_mesh(
        name=name,
        uservert=anywhere.ravel(),
        userface=faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )


def _strip(points: Array) -> Array:
    """Return the directions (2 n, 3) from points (n, 2) to both sides of a path on the floor."""
    steps = np.gradient(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    along = np.divide(steps, lengths, out=np.tile([1.0, 0.0], (len(points), 1)), where=lengths > 0)
    strip = np.zeros((2 * len(points), 3))
    strip[0::2, 0], strip[0::2, 1] = -along[:, 1], along[:, 0]
    strip[1::2] = -strip[0::2]
    return strip
