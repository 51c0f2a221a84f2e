"""What a model leaves out because its scene does not need it, and why."""

from robotball.engines.mujoco.chosen import Chosen
from robotball.engines.mujoco.hinges import hinges_of
from robotball.engines.mujoco.settings import Settings
from robotball.scene import Scene

DEFAULT_ITERATIONS = 100  # MuJoCo's own


def left_out(scene: Scene, settings: Settings) -> list[str]:
    """One line for each thing that a MuJoCo model of the ball could have and this one has not."""
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
