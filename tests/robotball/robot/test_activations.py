"""An actuator's filters and integrators, against exact solutions."""

import numpy as np
import pytest

import robotball as rb
from robotball.robot.drives import as_drive
from robotball.robot.motors import Activation, Law
from robotball.rotations import Array
from tests.messages import naming

TIMES, END = np.linspace(0.0, 10.0, 501), 10.0


def passed(activation: Activation, command: rb.robot.drives.Rate) -> Array:
    actuator = rb.Actuator("a", (), Law(1.0, 0.0, 0.0), command, activation)
    return np.array(as_drive(actuator.control(END), END).rate(TIMES))


@pytest.mark.parametrize(("settling", "most"), [(1e-3, 7e-12), (0.07, 1.3e-13), (1.0, 8e-15)])
def test_a_filtered_sine_lags_as_its_closed_form(settling: float, most: float) -> None:
    """Measured 2.3e-12, 4.1e-14 and 2.6e-15: roundings, which the steep exponential magnifies."""
    sine, turned = rb.Sine(amplitude=2.0, frequency=1.3, mean=0.3), 2 * np.pi * 1.3 * settling

    def steady(t: Array) -> Array:
        angle = 2 * np.pi * 1.3 * t
        lagging = (np.sin(angle) - turned * np.cos(angle)) / (1 + turned**2)
        return np.asarray(0.3 + 2.0 * lagging)

    exact = steady(TIMES) + (0.5 - steady(np.zeros(1))) * np.exp(-TIMES / settling)
    assert np.abs(passed(Activation(0.5, settling), sine) - exact).max() < most


@pytest.mark.parametrize("to", [2.0, -3.0])
def test_a_constant_command_stays_at_the_limit_that_it_reaches(to: float) -> None:
    """A filter and an integrator, from either side; roundings of 1.7e-15 at most."""
    filtered = passed(Activation(0.2, 0.5, -1.0, 1.5), to)
    assert np.abs(filtered - np.clip(to + (0.2 - to) * np.exp(-TIMES / 0.5), -1, 1.5)).max() < 6e-15
    summed = passed(Activation(0.2, None, -1.0, 1.5), to)
    assert np.abs(summed - np.clip(0.2 + to * TIMES, -1, 1.5)).max() < 6e-15
    with pytest.raises(rb.InputError, match=naming("filter 1e-05~s")):
        passed(Activation(0.2, 1e-5), rb.Ramp(final=1.0, end=2.0))
    with pytest.raises(rb.InputError, match=naming("a 1.5… keep")):
        passed(Activation(0.2, None, -1.0, 1.5), rb.Ramp(final=1.0, end=2.0))
