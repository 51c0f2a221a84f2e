"""A model as files for others: the MJCF with what a user must know, and what has to play it.

The run's own controls are computed at every evaluation of the forces. Without robotball they are
held over each step at the step's mean, so that the hinges are at their rates at its end; the
motion's error is then of second order, and the step is halved until it is small.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from textwrap import wrap

import mujoco
import numpy as np

from robotball.drives import Drive
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import START, Model, ModelHinge, build, hinges_of
from robotball.engines.mujoco.settings import Chosen, Prescribed, Settings
from robotball.rotations import Array
from robotball.scene import Scene

AGREES = 1e-6  # of the path: how far the motion of held controls may be off
HALVINGS = 5
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(3)  # for the mean of a command over a step
SAMPLES = 200  # of the path of a play
WIDTH = 95  # of a comment's lines

PLAYER = '''"""Plays {model} with its controls; it needs mujoco and numpy alone."""
from pathlib import Path
import mujoco, numpy as np

here = Path(__file__).parent
model = mujoco.MjModel.from_xml_path(str(here / "{model}"))
{softness}data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
for row in np.loadtxt(here / "{controls}", delimiter=",", skiprows=1, ndmin=2):
    data.ctrl[:] = row[1:]
    mujoco.mj_step(model, data)
print("t =", data.time, "s, qpos =", data.qpos.tolist())
'''
SOFTNESS = (
    "model.body_invweight0[:] *= {softness:g}  # an impedance nearer to 1 than MJCF can say\n"
)


@dataclass(frozen=True)
class Written:
    """A model's files: the MJCF, and where it needs one a player with its controls as CSV.

    needs: why it needs the player, in a line; None where any way of stepping it does.
    """

    xml: str
    needs: str | None = None
    player: str = ""
    controls: str = ""


def write_model(scene: Scene, settings: Settings, *, dressed: bool, stem: str) -> Written:
    """The files of a scene's model; stem: their names' first part, to which they refer."""
    model = build(scene, settings, dressed=dressed)
    softness = model.settings.softness
    if scene.steady and softness == 1:
        return Written(_with_comment(model, _words(model, None)))
    off = None
    if not scene.steady:
        step, off = _step_for(scene, settings)
        model = build(scene, replace(settings, timestep=step), dressed=dressed)
    needs = _needs(model, f"{stem}-play.py", off)
    rows = _held(model)
    header = ["time", *(hinge.body for hinge in model.hinges if hinge.actuated)]
    times = np.arange(len(rows)) * model.compiled.opt.timestep
    lines = [",".join(map(repr, row)) for row in np.column_stack([times, rows]).tolist()]
    return Written(
        _with_comment(model, _words(model, needs)),
        needs,
        PLAYER.format(
            model=f"{stem}.xml",
            controls=f"{stem}-controls.csv",
            softness="" if softness == 1 else SOFTNESS.format(softness=softness),
        ),
        "\n".join([",".join(header), *lines]) + "\n",
    )


def _needs(model: Model, player: str, off: float | None) -> str:
    why = []
    if off is not None:
        why.append(
            "its controls change in time, and the keyframe has those of the start alone (held over "
            f"each step, the path is off by about {off:.0e} of its length)"
        )
    if model.settings.softness != 1:
        why.append("its contact is harder than MJCF can say")
    return f"it needs {player} to move as it should: {' and '.join(why)}"


def _words(model: Model, needs: str | None) -> list[str]:
    scene, settings, option = model.scene, model.settings, model.compiled.opt
    integrator = mujoco.mjtIntegrator(option.integrator).name.removeprefix("mjINT_")
    lines = [
        f"{scene.name}, preset {settings.name}. robotball {version('robotball')}, "
        f"{LABEL.name} {LABEL.version}. SI units.",
        f'Start: the keyframe "{START}". Reset to it; without it the ball stands at the origin, at '
        "rest.",
        f"Integrator: {integrator} at {option.timestep:g} s, as it is set here. "
        "Integrators of first order lose or gain M.",
    ]
    if any(isinstance(hinge.actuation, Prescribed) for hinge in model.hinges):
        lines += [
            "Armature: so huge that no load changes a hinge's rate. It acts on the hinge alone; "
            "the ball has no momentum of it.",
            "Motors: their gear is the armature, so a control is an acceleration [rad/s²].",
        ]
    if scene.friction.rolling:
        lines.append(
            "Not in it: the resistance to rolling, which a run of robotball adds as a torque of "
            f"{scene.friction.rolling:g} m times the normal force on the shell, against its "
            "horizontal angular velocity."
        )
    if settings.start_in_equilibrium:
        lines.append("Margin: the depth at which the contact carries the ball at its own radius.")
    lines.append(
        "MJX has no PGS and no noslip, and so refuses a model with them; with Newton and noslip "
        "taken out, it computes in 32 bits unless it is told otherwise, which is seven digits."
    )
    return lines if needs is None else [*lines, f"Player: {needs}."]


def _with_comment(model: Model, lines: Sequence[str]) -> str:
    # Two hyphens would end a comment.
    wrapped = [part for line in lines for part in wrap(line.replace("--", "- -"), WIDTH)]
    text = "\n     ".join(wrapped)
    return f"<!-- {text} -->\n{model.xml}"


def _step_for(scene: Scene, settings: Settings) -> tuple[float, float]:
    """The step [s] at which held controls are good enough, and the path error expected of it.

    The settings' own step where none is, as of settings that are wrong for other reasons.
    """
    first = build(scene, settings).compiled.opt.timestep
    before, worst = _played(scene, settings, first, 1), 0.0
    scale = max(float(np.linalg.norm(np.diff(before, axis=0), axis=1).sum()), scene.ball.radius)
    for parts in (2**i for i in range(1, HALVINGS + 1)):
        path = _played(scene, settings, first / parts, parts)
        # Of second order: a third of the difference is left.
        off = float(np.linalg.norm(path - before, axis=1).max()) / scale / 3
        if off < AGREES / 3:
            return first / parts, off
        before, worst = path, max(worst, 4 * off)
    return first, worst


def _played(scene: Scene, settings: Settings, step: float, parts: int) -> Array:
    """The contact points (SAMPLES, 2) of a run with held controls, at the same times [m].

    parts: how many of its steps are one of those of the run that it is compared with.
    """
    model = build(scene, replace(settings, timestep=step))
    data, rows = model.start_data(), _held(model)
    kept = set((parts * np.linspace(0, len(rows) // parts, SAMPLES).astype(int)).tolist())
    points = [data.qpos[:2].copy()]
    for i, row in enumerate(rows, start=1):
        data.ctrl[:] = row
        mujoco.mj_step(model.compiled, data)
        if i in kept:
            points.append(data.qpos[:2].copy())
    return np.array(points)


def _held(model: Model) -> Array:
    """The controls (steps, actuators) over the scene's duration: each step's mean."""
    step = model.compiled.opt.timestep
    edges = np.arange(round(model.scene.duration / step) + 1) * step
    columns = [_mean(hinge, edges) for hinge in model.hinges if hinge.actuated]
    return np.stack(columns, axis=1) if columns else np.zeros((len(edges) - 1, 0))


def _mean(hinge: ModelHinge, edges: Array) -> Array:
    """The mean (n,) of a hinge's control between n + 1 times [s]."""
    drive: Drive = hinge.drive
    if isinstance(hinge.actuation, Prescribed):
        return np.asarray(np.diff(drive.rate(edges)) / np.diff(edges))
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    return np.asarray(
        sum(w * drive.rate(middle + x * half) for x, w in zip(GAUSS, WEIGHTS / 2, strict=True))
    )


DEFAULT_ITERATIONS = 100  # MuJoCo's own


def left_out(scene: Scene, settings: Settings) -> list[str]:
    """Return a line for each thing that a MuJoCo model of the ball could have and this has not."""
    lines, settings = [], Chosen(scene, settings).settings
    if not scene.ball.rotors:
        lines.append("rotor bodies: the scene has none")
    elif len(scene.ball.rotors) == 1:
        lines.append("more rotor bodies: one along K + (J_s + d)Ω makes the same motion")
    turning = {hinge.body for hinge in hinges_of(scene, settings)}
    lines += [
        f"the hinge of {hinge.name}: its rate is zero for good, so it is fixed to its parent"
        for hinge in scene.hinges
        if hinge.name not in turning
    ]
    if scene.rolling == "classical":
        lines.append(
            "the torsional friction row (condim 4): the classical ball may spin on the spot"
        )
    if scene.friction.rolling:
        lines.append(
            "rolling friction (condim 6): it acts against an acceleration and shares a cone with "
            "what holds the ball; a torque on the shell resists the rolling, at every evaluation"
        )
    else:
        lines.append("rolling friction (condim 6): neither rolling model has it; it would eat M")
    lines.append("collision detection but for one pair: the shell and the plane")
    lines.append("geoms of frame and rotors, lights, textures, materials: a run is not looked at")
    lines.append("sensors but for those that a Motion is made of")
    if settings.solver == "PGS" and settings.iterations is not None:
        lines.append(
            f"Newton's solver and {DEFAULT_ITERATIONS} iterations: one contact is solved by PGS in "
            f"{settings.iterations}"
        )
    if settings.softness != 1:
        lines.append(
            f"the contact's softness but for {settings.softness:g} of it, as the load varies: once "
            "the model is compiled its body_invweight0 is scaled, for which MJCF has no word"
        )
        lines.append(
            f"the quicker PGS: a load that varies couples it with friction; {settings.solver} "
            f"solves both in {settings.iterations} iterations"
        )
    if settings.warmstart == "disable":
        lines.append("the warm start: so few iterations need no guess, and a state has one motion")
    if settings.island == "disable":
        lines.append("the search for islands of contacts: there is one contact")
    return lines
