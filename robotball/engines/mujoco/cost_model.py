"""The cost model: what each family of steps reaches and costs, by a scene's own rates."""

from dataclasses import dataclass

import numpy as np

from robotball.rotations import rotation_matrix
from robotball.scene import Scene


@dataclass(frozen=True)
class CostModel:
    """What was measured over the catalog and 30 random balls, 10 s each; rate is `scene_rate`.

    `python -m validation.bench.cost_model` measures it again, and says how far scenes scatter.
    """

    # A path error goes at least with this power of the timestep and of rtol.
    order: float = 3.8
    rtol_order: float = 0.85
    # DOP853's error, as the change of its M tells it, over rtol is
    # gain * (RK4's error / (rate * timestep)^4)^power, within a factor of 3 for most scenes.
    gain: float = 400.0
    power: float = 0.64
    # It takes density * rate * duration * (1e-11 / rtol)^growth steps.
    density: float = 2.95
    growth: float = 0.12
    # Seconds: a step of RK4, a step of DOP853, a sample between its steps; and of controls that
    # change in time, at each evaluation of the forces.
    step: float = 17e-6
    adaptive_step: float = 250e-6
    sample: float = 27e-6
    control: float = 8e-6

    def steps_per_second(self, rate: float, rtol: float) -> float:
        """How many steps DOP853 takes in a simulated second."""
        return self.density * rate * (1e-11 / rtol) ** self.growth


COST_MODEL = CostModel()


def scene_rate(scene: Scene) -> float:
    """The rate by which the scene's errors scale [1/s], the largest while its drives change.

    The root of |AK|² + |Ω|² + |AM|² + |ω|², at its start.
    """
    times = [0.0] if scene.steady else np.linspace(0.0, scene.duration, 50)
    omega = scene.principal_axes.T @ scene.angular_velocity_at(scene.start)
    M = scene.principal_axes.T @ rotation_matrix(scene.start.attitude).T @ scene.start.momentum
    squares = []
    for parameters in map(scene.parameters_at, times):
        A = np.array(parameters.A)
        rates = (A * parameters.K, parameters.Omega, A * M, omega)
        squares.append(sum(float(np.dot(rate, rate)) for rate in rates))
    return float(np.sqrt(max(squares)))
