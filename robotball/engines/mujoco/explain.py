"""What a model leaves out because its scene does not need it, and why."""

from robotball.drives import turns
from robotball.engines.mujoco.settings import Settings
from robotball.scene import Scene

DEFAULT_ITERATIONS = 100  # MuJoCo's own


def left_out(scene: Scene, settings: Settings) -> list[str]:
    """One line for each thing that a MuJoCo model of the ball could have and this one has not."""
    lines = []
    if not scene.ball.rotors:
        lines.append("rotor bodies: the scene has none")
    elif len(scene.ball.rotors) == 1:
        lines.append("more rotor bodies: one along K + (J_s + d)Ω makes the same motion")
    names = ["frame", *(f"rotor{i}" for i in range(1, 1 + len(scene.ball.rotors)))]
    lines += [
        f"the hinge of {name}: its rate is zero for good, so it is fixed to its parent"
        for name, drive in zip(names, scene.drives, strict=True)
        if not turns(drive)
    ]
    if scene.rolling == "classical":
        lines.append(
            "the torsional friction row (condim 4): the classical ball may spin on the spot"
        )
    lines.append("rolling friction (condim 6): neither rolling model has it, and it would eat M")
    lines.append("collision detection but for one pair: the shell and the plane")
    lines.append("geoms of frame and rotors, lights, textures, materials: a run is not looked at")
    lines.append("sensors but for those that a Motion is made of")
    if settings.solver == "PGS" and settings.iterations is not None:
        lines.append(
            f"Newton's solver and {DEFAULT_ITERATIONS} iterations: one contact is solved by PGS in "
            f"{settings.iterations}"
        )
    if settings.warmstart == "disable":
        lines.append("the warm start: so few iterations need no guess, and a state has one motion")
    if settings.island == "disable":
        lines.append("the search for islands of contacts: there is one contact")
    return lines
