"""Export a model: its MJCF with a visual appearance, and a player for changing controls.

A run computes its controls at every evaluation of the forces. The player holds the mean of the
controls over each step, so the hinges have the right rates at the end of the step. The error is
then of second order, and the step is halved until the error is small.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from textwrap import wrap
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import START, Model, build
from robotball.engines.mujoco.settings import Prescribed, Settings
from robotball.robot.ball import PARTS
from robotball.robot.drives import Drive
from robotball.robot.looks import BLUR, add_materials, looks_of
from robotball.robot.scene import Scene
from robotball.robot.shapes import add_geoms
from robotball.rotations import Array, conjugate, rotation_matrix
from robotball.theory.plane import check_still
from robotball.user_model.mended_file import in_comment

_AGREES = 1e-6  # of the path: largest error due to held controls
_STEP = 2e-3  # s, step of RK4, which replaces an integrator that MuJoCo does not have
_HALVINGS = 5  # largest number of halvings, which gives 32 times as many rows of controls
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)  # for the mean of a command over a step
_SAMPLES = 200  # of the path of a play
_WRAP, _COMMENT_LINE = 95, "\n     "  # the width of a comment, and its line break
# Lengths of the picture in radii of the ball, so that every ball fills it.
_CAMERA, _EXTENT, _SUN, _TILE = "0 -5 2", 4.0, 12.0, 0.5

_MODEL, _PLAYER, _CONTROLS = "mujoco.xml", "mujoco-play.py", "mujoco-controls.csv"
_SCRIPT = f'''"""Play the model beside this file with its controls; needs only mujoco and numpy."""
from pathlib import Path
import mujoco, numpy as np

here = Path(__file__).parent
model = mujoco.MjModel.from_xml_path(str(here / "{_MODEL}"))
{{softness}}data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
for row in np.loadtxt(here / "{_CONTROLS}", delimiter=",", skiprows=1, ndmin=2):
    data.ctrl[:] = row[1:]
    mujoco.mj_step(model, data)
print("t =", data.time, "s, qpos =", data.qpos.tolist())
'''
_SOFTNESS = "model.body_invweight0[:] *= {softness:g}  # an impedance nearer to 1 than MJCF's\n"


@dataclass(frozen=True)
class Written:
    """The MJCF of a scene, and a script that plays it if its controls change.

    Attributes
    ----------
    xml : str
        The MJCF.
    needs : str, optional
        Why the MJCF needs the player, in one line. None if the MJCF alone suffices.
    files : mapping of str to str
        The text of each file by name: the MJCF, and the player with its controls.
    """

    xml: str
    needs: str | None
    files: Mapping[str, str]


def write_model(scene: Scene, settings: Settings) -> Written:
    """Return the model of a run with shapes, lights and a camera for a viewer."""
    scene.check_open("MJCF")
    check_still(scene, "MJCF")
    if not settings.own:
        settings = replace(settings, integrator="RK4", timestep=_STEP)
    model = build(scene, settings)
    softness = model.settings.softness
    needs, off = None, None
    if not scene.steady:
        step, off = _step_for(scene, settings)
        model = build(scene, replace(settings, timestep=step))
    # MJCF cannot express the softness or changing controls: the player sets both.
    if not scene.steady or softness != 1:
        needs = _needs(model, off)
    wrapped = [part for line in _words(model, needs) for part in wrap(in_comment(line), _WRAP)]
    xml = f"<!-- {_COMMENT_LINE.join(wrapped)} -->\n{dress(model).xml}"
    if needs is None:
        return Written(xml, None, {_MODEL: xml})
    rows = _mean_controls(model)
    actuated = [hinge.name for hinge in model.hinges if hinge.actuated]
    header = ["time", *actuated, *(actuator.name for actuator in scene.actuators)]
    times = np.arange(len(rows)) * model.compiled.opt.timestep
    lines = [",".join(map(repr, row)) for row in np.column_stack([times, rows]).tolist()]
    script = _SCRIPT.format(softness="" if softness == 1 else _SOFTNESS.format(softness=softness))
    controls = "\n".join([",".join(header), *lines]) + "\n"
    return Written(xml, needs, {_MODEL: xml, _PLAYER: script, _CONTROLS: controls})


def _needs(model: Model, off: float | None) -> str:
    """Return why the model needs its player; off: the path error of held controls, if any."""
    why = []
    if off is not None:
        why.append(
            "its controls change in time, and the keyframe has only the controls of the start "
            f"(held over each step, they cause a path error of about {off:.0e})"
        )
    if model.settings.softness != 1:
        why.append("its contact is harder than MJCF can express")
    return f"it needs {_PLAYER} to move correctly: {' and '.join(why)}"


def _words(model: Model, needs: str | None) -> list[str]:
    """Return the lines of the comment at the head of the MJCF."""
    scene, settings, option = model.scene, model.settings, model.compiled.opt
    integrator = mujoco.mjtIntegrator(option.integrator).name.removeprefix("mjINT_")
    lines = [
        f"{scene.name}, preset {settings.name}. robotball {version('robotball')}, "
        f"{LABEL.name} {LABEL.version}. SI units.",
        f'Start: the keyframe "{START}". Reset to it; otherwise the ball is at rest at the origin.',
        f"Integrator: {integrator} at {option.timestep:g} s. "
        "Integrators of first order lose or gain M.",
    ]
    if any(isinstance(hinge.actuation, Prescribed) for hinge in model.hinges):
        lines += [
            "Armature: so large that no load changes a hinge's rate. It acts on the hinge alone "
            "and adds no momentum to the ball.",
            "Motors: their gear is the armature, so a control is an acceleration [rad/s²].",
        ]
    if scene.friction.rolling:
        lines.append(
            "Not included: the resistance to rolling, which robotball adds as a torque of "
            f"{scene.friction.rolling:g} m times the normal force on the shell, against its "
            "horizontal angular velocity."
        )
    if model.dry_friction is not None:
        lines.append(
            "Dry friction: frictionloss is a soft row, which acts along a rate shortly before a "
            "load reverses it. robotball applies a torque of the same size instead."
        )
    if settings.slips:
        lines.append(
            "Slip: solref, solimp, impratio and solreffriction only help together, and with this "
            "timestep. For another timestep, export again."
        )
    elif settings.slips is False:
        lines.append(
            "Friction: larger than the scene's, which this motion does not exceed. For another "
            "motion, export again."
        )
    elif settings.solreffriction is not None:
        lines.append(
            "Friction: enough to roll without slip. If you lower it, the ball slips wrongly, by a "
            "seventh of its path or more, because solreffriction is too weak to end a slip. For "
            "another contact, which slips rightly, give sliding in [friction] of the scene file, "
            "or the option friction of robotball export, and export again."
        )
    if settings.start_in_equilibrium:
        lines.append("Margin: the depth at which the contact carries the ball at its radius.")
    lines.append(
        "MJX refuses PGS and noslip. With Newton and without noslip it computes in 32 bits, which "
        "are seven digits, unless it is set to 64."
    )
    return lines if needs is None else [*lines, f"Player: {needs}."]


def _step_for(scene: Scene, settings: Settings) -> tuple[float, float]:
    """Return a step [s] for accurate held controls, or the settings' step, and its path error."""
    first = build(scene, settings).compiled.opt.timestep
    before, worst = _played(scene, settings, first, 1), 0.0
    # At least the radius, for a ball that hardly moves.
    scale = max(float(np.linalg.norm(np.diff(before, axis=0), axis=1).sum()), scene.ball.radius)
    for parts in (2**i for i in range(1, _HALVINGS + 1)):
        path = _played(scene, settings, first / parts, parts)
        # With second order, half the step has a quarter of the error, which is a third of the
        # difference.
        off = float(np.linalg.norm(path - before, axis=1).max()) / scale / 3
        if off < _AGREES / 3:
            return first / parts, off
        before, worst = path, max(worst, 4 * off)
    return first, worst


def _played(scene: Scene, settings: Settings, step: float, parts: int) -> Array:
    """Return contact points (_SAMPLES, 2) [m] with held controls; `parts`: steps per interval."""
    model = build(scene, replace(settings, timestep=step))
    data, rows = model.start_data(), _mean_controls(model)
    kept = set((parts * np.linspace(0, len(rows) // parts, _SAMPLES).astype(int)).tolist())
    points = [data.qpos[:2].copy()]
    for i, row in enumerate(rows, start=1):
        data.ctrl[:] = row
        mujoco.mj_step(model.compiled, data)
        if i in kept:
            points.append(data.qpos[:2].copy())
    return np.array(points)


def _mean_controls(model: Model) -> Array:
    """Return the mean controls of each step (steps, actuators) over the scene's duration."""
    step = model.compiled.opt.timestep
    edges = np.arange(round(model.scene.duration / step) + 1) * step
    columns = [
        # The control is an acceleration, and the rates at the edges give its exact mean.
        np.diff(hinge.command.rate(edges)) / np.diff(edges)
        if isinstance(hinge.actuation, Prescribed)
        else _mean(hinge.command, edges)
        for hinge in model.hinges
        if hinge.actuated
    ]
    columns += [_mean(command, edges) for command in model.scene.controls]
    return np.stack(columns, axis=1) if columns else np.zeros((len(edges) - 1, 0))


def _mean(drive: Drive, edges: Array) -> Array:
    """Return the mean (n,) of a command between n + 1 times [s]."""
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    nodes = zip(_GAUSS, _WEIGHTS / 2, strict=True)
    return np.asarray(sum(w * drive.rate(middle + x * half) for x, w in nodes))


def dress(model: Model) -> Model:
    """Return the model with shapes, materials, lights and a camera. Its motion is the same."""
    ball = model.scene.ball
    root, unit = ElementTree.fromstring(model.xml), ball.radius
    floor = ElementTree.parse(PARTS / "floor.xml").getroot()
    worldbody, assets = _child(root, "worldbody"), Element("asset")
    assets.extend(_child(floor, "asset"))
    _child(assets, "material").set("texrepeat", f"{_TILE / unit:g} {_TILE / unit:g}")
    _child(worldbody, "geom").set("material", "floor")
    looks, stands = looks_of(ball), _stands(model.compiled)
    add_materials(assets, looks)
    for body in worldbody.iter("body"):
        shapes = [shape for shape in looks[body.attrib["name"]] if shape.material != BLUR]
        if (sphere := body.find("geom")) is not None:  # the model has the shell's sphere
            sphere.set("material", "shell")
            shapes = [shape for shape in shapes if shape.material != "shell"]
        origin, turn = stands[body.attrib["name"]]
        shift = -rotation_matrix(turn) @ origin / unit
        add_geoms(assets, body, [shape.moved(turn, shift) for shape in shapes], unit)
    ball_body, sun = _child(worldbody, "body"), _child(_child(floor, "worldbody"), "light")
    place = " ".join(f"{float(part) * unit:g}" for part in _CAMERA.split())
    SubElement(ball_body, "camera", name="track", mode="trackcom", pos=place, xyaxes="1 0 0 0 2 5")
    sun.attrib.update(mode="trackcom", pos=f"0 0 {_SUN * unit:g}")
    ball_body.append(sun)
    size = Element("statistic", center=f"0 0 {unit:g}", extent=f"{_EXTENT * unit:g}")
    place_of_world = list(root).index(worldbody)
    root[place_of_world:place_of_world] = [size, _child(floor, "visual"), assets]
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode") + "\n"
    return replace(model, xml=text, original=None)


def _child(element: Element, tag: str) -> Element:
    child = element.find(tag)
    assert child is not None
    return child


def _stands(model: mujoco.MjModel) -> dict[str, tuple[Array, Array]]:
    """Return each body's position from the sphere's centre [m] and its axes, hinges at 0."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    data.qpos[3] = 1
    mujoco.mj_kinematics(model, data)
    centre = data.body("shell").xpos
    return {
        model.body(i).name: (data.xpos[i] - centre, conjugate(data.xquat[i]))
        for i in range(1, model.nbody)
    }
