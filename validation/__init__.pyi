"""The names of `validation`, each from its home; loaded when they are first used."""

from .agreement import Agreement as Agreement
from .agreement import compare as compare
from .parameter_sweep import Sweep as Sweep
from .parameter_sweep import sweep as sweep
from .random_starts import ManyRuns as ManyRuns
from .random_starts import compare_many as compare_many
from .results import assert_agrees as assert_agrees
from .studies.judge import Judgement as Judgement
from .studies.judge import judge as judge
