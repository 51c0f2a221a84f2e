"""Everything that is compiled, compiled ahead of its first use, as set-up does."""

from robotball.engines.compiled import Compiled
from robotball.engines.ensembles import crossings, flatten, orbits, steppers
from robotball.engines.multibody import derivative
from robotball.equations import ROLLING_MODELS


def compile_all() -> None:
    """Compile all that is compiled, or load it, as set-up does for the first commands."""
    for module in (derivative, orbits, crossings):
        for each in vars(module).values():
            if isinstance(each, Compiled):
                each.code  # noqa: B018
    for rolling in ROLLING_MODELS:
        steppers.stepper(steppers.PATH, rolling, flatten.FEW)
        for one in (steppers.PATH, steppers.RETURN, steppers.ARC, steppers.DEVIATION):
            steppers.stepper(one, rolling)
