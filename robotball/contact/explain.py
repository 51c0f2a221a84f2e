"""What a model leaves out because its scene does not need it, and why."""

from robotball.contact.hinges import hinges_of
from robotball.drives import turns
from robotball.scene import Scene
from robotball.settings import Settings


def left_out(scene: Scene, settings: Settings) -> list[str]:
    """One line for each thing that a MuJoCo model of the ball could have and this one has not."""
    lines = []
    if not scene.ball.rotors:
        lines.append("rotor bodies: the scene has none")
    names = ["frame", *(f"rotor{i}" for i in range(1, 1 + len(scene.ball.rotors)))]
    lines += [
        f"the hinge of {name}: its rate is zero for good, so it is fixed to its parent"
        for name, drive in zip(names, scene.drives, strict=True)
        if not turns(drive)
    ]
    lines += [
        f"the actuator of {hinge.body}: its rate is constant, and a huge armature keeps it"
        for hinge in hinges_of(scene, settings)
        if not hinge.actuated
    ]
    if scene.rolling == "classical":
        lines.append(
            "the torsional friction row (condim 4): the classical ball may spin on the spot"
        )
    lines.append("rolling friction (condim 6): neither rolling model has it, and it would eat M")
    lines.append("collision detection but for one pair: the shell and the plane")
    lines.append("geoms of frame and rotors, lights, textures, materials: a run is not looked at")
    lines.append("sensors but for those that a Motion is made of")
    return lines
