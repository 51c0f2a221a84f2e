"""The depth at which the contact carries the weight, found in the model itself."""

import contextlib
import warnings
from typing import Any

import mujoco
import numpy as np
from scipy.optimize import root_scalar

from robotball.engines.mujoco.chosen import Chosen
from robotball.engines.mujoco.settings import Settings
from robotball.errors import InputError
from robotball.scene import Scene


def compiled_model(xml: str, softness: float = 1.0) -> Any:
    """The MjModel of an MJCF text, its contact so many times as soft.

    Raises InputError where MuJoCo refuses it.
    """
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"MuJoCo refuses the model: {error}") from None
    # The bodies' inverse weights do nothing but scale the constraints' regulariser, which so gets
    # as small as an impedance nearer to 1 than MuJoCo's .9999 would make it.
    model.body_invweight0[:] *= softness
    return model


def carrying_depth(scene: Scene, settings: Settings, xml: str) -> float:
    """The depth [m] at which the contact carries the weight: as the pair's margin it lets the
    ball start at rest vertically with its centre at the height of its radius.

    Raises InputError where there is no such depth, for the contact has no stiffness.
    """
    model = compiled_model(xml, settings.softness)
    data = mujoco.MjData(model)
    if settings.softness < 1:
        # So hard a contact hardly slips without the noslip solver. That takes the acceleration from
        # the forces, whose rounding is magnified until no depth is found.
        model.opt.noslip_iterations = 0

    def vertical_acceleration(margin: float) -> float:
        mujoco.mj_resetDataKeyframe(model, data, 0)
        model.pair_margin[0] = margin
        mujoco.mj_forward(model, data)
        return float(data.qacc[2])

    chosen = Chosen(scene, settings)
    if not 0 < chosen.normal_reference[0] < np.inf:
        raise InputError(
            f"the contact cannot carry the ball at any depth: solref {chosen.solref} has no "
            "stiffness; give another, or start_in_equilibrium off"
        )
    # The acceleration is nearly linear in the depth: g is about k times it.
    scale = settings.softness * scene.gravity / chosen.normal_reference[0]
    with warnings.catch_warnings(), contextlib.suppress(ValueError):  # no secant to follow
        warnings.simplefilter("ignore")
        found = root_scalar(vertical_acceleration, x0=scale, x1=1.1 * scale, xtol=1e-16)
        if found.converged and 0 < found.root < np.inf:
            return float(found.root)
    # A ball that slips from the start is thrown up at any depth; the normal force alone has one.
    return chosen.equilibrium_depth
