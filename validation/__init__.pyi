"""The names of `validation`, each from its home; loaded when they are first used."""

from .comparison.agreement import Agreement as Agreement
from .comparison.agreement import compare as compare
from .studies.judge.measure import Judgement as Judgement
from .studies.judge.measure import judge as judge
