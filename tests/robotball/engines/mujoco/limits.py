"""What is predicted of a run, and the run that it is held against."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

import robotball as rb
from robotball.engines.mujoco.limits import LimitCheck, PlannedRun, planned
from validation import Agreement, compare

FIG12, REGULAR = rb.load_scene("fig12"), rb.load_scene("classical_regular")
FAST = replace(rb.preset("fast"), stop_at_fault=False)


def the_limit(
    predict: Callable[[PlannedRun], LimitCheck | None],
    scene: rb.Scene,
    settings: rb.Settings,
    duration: float,
) -> LimitCheck:
    limit = predict(planned(scene, settings, duration))
    assert limit is not None
    return limit


def run(scene: rb.Scene, settings: rb.Settings, duration: float) -> Agreement:
    return compare(scene, settings, np.linspace(0.0, duration, 51))


def error(agreement: Agreement) -> float:
    """The path error; infinite where the run broke off."""
    return np.inf if agreement.path_error is None else agreement.path_error


def of_momentum(agreement: Agreement) -> float:
    assert agreement.momentum_error is not None
    return agreement.momentum_error
