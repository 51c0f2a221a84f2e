"""Check a user's model: observe its file, propose changes, and find those that are needed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotball.engines.mujoco.user_model import UserModel, observed
from robotball.errors import mujoco_silent
from robotball.motion import Motion, arrays_of, with_arrays
from robotball.robot.formulas import Rolling

from ..output import Show
from .ablate import Ablation, ablate, first_trials
from .observe import Observation, observe, path_error
from .unusual import Unusual, unusual_numbers


@dataclass(frozen=True)
class Checked:
    """The outcome of a check.

    Attributes
    ----------
    observation : Observation
    ablation : Ablation
    duration : float, s
        The time that was asked for.
    short : str or None
        Why less time was compared.
    unusual : sequence of Unusual
        Numbers that file and reference share.
    """

    observation: Observation
    ablation: Ablation
    duration: float
    short: str | None
    unusual: Sequence[Unusual]

    @property
    def agrees(self) -> bool:
        """Whether the file moves and rolls as the reference does, all the time asked for."""
        seen = self.observation
        return seen.failure is None and self.short is None and seen.error <= seen.accuracy

    @property
    def mended_error(self) -> float:
        """The path error of the mended file."""
        return path_error(self.ablation.mended, self.observation.theory)


@mujoco_silent()  # a diverged state is reported in words
def check_model(
    user: UserModel, rolling: Rolling | None, duration: float, accuracy: float, show: Show
) -> Checked:
    """Check a user's model against ideal rolling.

    rolling: the nearer model if None. duration [s]: less is compared if the robot meets an
    obstacle, or all would take too long. accuracy: the path error to reach. show: called with the
    finished part and the next piece of work.
    """
    short, compared = None, duration
    while True:
        observation = observe(user, rolling, compared, accuracy, show)
        trials, obstacle = first_trials(observation, show)
        if obstacle is None:
            break
        # The equations leave out the obstacle, so compare again, up to shortly before it.
        compared = obstacle.time - 2 * observation.interval
        short = f"ends early: {obstacle.words} at t = {obstacle.time:.3g} s of {duration:.3g} s"
    theory, robot = observation.theory, user.robot
    end = float(theory.times[-1])
    if theory.ended:
        short = f"limit: {theory.ended} of {duration:.3g} s"
    elif end < observation.duration - observation.interval / 2:
        short = f"only {end:.3g} s of {duration:.3g} s are checked: all would take too long"
    level = bool(np.allclose(robot.plane_axes(user.begin()), np.eye(3)))
    unusual = [*unusual_numbers(theory.scene, level)]
    return Checked(observation, ablate(trials), duration, short, unusual)


def motions_of(checked: Checked) -> list[Motion]:
    """Return the motions of the file, of the mended file if it is changed, and of the reference.

    They are at the same times, as long as each lasts.
    """
    observation, ablation = checked.observation, checked.ablation
    motion, theory = observation.motion, observation.theory
    motions = [motion]
    if ablation.needed:
        mended = observation.user.with_text(ablation.text)
        every = round(theory.times[1] / mended.robot.model.opt.timestep)
        error = checked.mended_error
        motions.append(observed(mended, motion.scene, error, every, name="mended")[0])
    sampled = []
    for run in motions:
        # A time of the model is a sum of steps.
        times = theory.times[theory.times < run.times[-1] + run.report.timestep / 2]
        if len(times) < 2:  # it diverged at once
            continue
        rows = np.abs(run.times - times[:, None]).argmin(axis=1)
        arrays = {place: array[rows] for place, array in arrays_of(run)}
        sampled.append(with_arrays(run, arrays | {("times",): times}))
    return [*sampled, theory]
