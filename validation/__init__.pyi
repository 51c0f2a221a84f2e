"""The names of `validation`, each from its home; loaded when they are first used."""

from .agreement import Agreement as Agreement
from .agreement import compare as compare
from .check.checking import RobotCheck as RobotCheck
from .check.checking import check_robot as check_robot
from .many_runs import ManyRuns as ManyRuns
from .many_runs import Sweep as Sweep
from .many_runs import compare_many as compare_many
from .many_runs import sweep as sweep
from .results import assert_agrees as assert_agrees
from .studies.judge import Judgement as Judgement
from .studies.judge import judge as judge
