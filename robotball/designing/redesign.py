"""A scene with other bodies and the same motion: those that `design` finds for its numbers."""

from dataclasses import replace

from robotball.designing.design import Design, design
from robotball.designing.feasibility import Limits
from robotball.scene import Scene


def redesign(scene: Scene, mass: float | None, limits: Limits) -> tuple[Design, Scene]:
    """The design for the scene's own A, Ω, K and radius, and the scene with its bodies.

    mass: the ball's [kg]; if None, the best one in the rubber model, and the scene's own in the
    classical one, whose (3.3) knows d = m a² beside A, Ω and K. The new scene has no motors. Raises
    InputError where the rates are not constant or there is no such ball.
    """
    if mass is None and scene.rolling == "classical":
        mass = scene.ball.mass
    numbers, axes = scene.parameters, scene.principal_axes
    found = design(
        scene.ball.A, axes @ numbers.Omega, axes @ numbers.K, scene.ball.radius, mass, limits
    )
    return found, replace(
        scene,
        name=f"{scene.name}_designed",
        title=f"{scene.title}, designed bodies",
        source=f"Bodies designed for the numbers of {scene.name}. {found.verdict}\n{scene.source}",
        ball=found.ball,
        frame_rate=found.frame_rate,
        rotor_rates=found.rotor_rates,
        motors=(),
    )
