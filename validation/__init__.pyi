"""The names of `validation`, each from its home; loaded when they are first used."""

from .comparison.agreement import Agreement as Agreement
from .comparison.agreement import compare as compare
