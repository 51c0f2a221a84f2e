"""Error and cost of each family of steps, fitted to the catalog and 30 random balls, 10 s each.

The rate is `accuracy.scene_rate`. `python -m bench.cost_model` fits the numbers again and
prints how far scenes scatter about them.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class _CostModel:
    # A path error goes at least with this power of the timestep and of rtol.
    order: float = 3.8
    rtol_order: float = 0.85
    # DOP853's error over rtol, estimated from the change of its M, is
    # gain * (RK4's error / (rate * timestep)^4)^power, within a factor of 3 for most scenes.
    gain: float = 400.0
    power: float = 0.64
    # DOP853 takes density * rate * duration * (1e-11 / rtol)^growth steps.
    density: float = 2.95
    growth: float = 0.12
    # Seconds: a step of RK4, a step of DOP853, a sample between its steps; and of controls that
    # change in time, at each evaluation of the forces.
    step: float = 17e-6
    adaptive_step: float = 250e-6
    sample: float = 27e-6
    control: float = 8e-6

    def steps_per_second(self, rate: float, rtol: float) -> float:
        """Return the number of steps that DOP853 takes in a simulated second."""
        return self.density * rate * (1e-11 / rtol) ** self.growth


COST_MODEL = _CostModel()
