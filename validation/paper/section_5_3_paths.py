"""Section 5.3, the contact point in Figs 12 to 14."""

from functools import partial

import numpy as np

from robotball.engines.reduced.compiled.kernels import kernel_start, orbit
from validation.paper.captions import captioned_motion, place
from validation.paper.claim import AtLeast, Claim, Residual
from validation.paper.engine import MOTION, long
from validation.paper.scenes import paper_scene


def mean_motion(name: str, twist: float) -> AtLeast:
    """X of MuJoCo's contact point after 150 s, over the time; twisted, Y."""
    end = long(name, 150.0).motion.contact_point[-1]
    return AtLeast(abs(float(end[0 if twist == 1 else 1])) / 150.0, bound=1.0, unit="m/s")


def bounded_across(name: str, twist: float) -> Residual:
    """The range of Y in 150 s of MuJoCo's motion over that in half of it; twisted, of Fig. 14."""
    Y = long(name if twist == 1 else "fig14", 150.0).motion.contact_point[:, 1]
    return Residual(float(np.ptp(Y) / np.ptp(Y[: len(Y) // 2])), bound=1.03)


def grows_across(twist: float) -> AtLeast:
    """The range of Y in 4000 s of Fig. 14's motion by (3.2) over that in 100 s; twisted, of 13."""
    parameters, attitude, momentum = kernel_start(paper_scene("fig14" if twist == 1 else "fig13"))
    times = np.arange(0.0, 4000.0, 0.05)
    _, path = orbit(parameters, attitude[0], momentum[0], times, 1e-10)
    return AtLeast(float(np.ptp(path[:, 1]) / np.ptp(path[:2000, 1])), bound=2.0)


CLAIMS = (
    captioned_motion("fig12", 4e-7),
    captioned_motion("fig13", 4e-7),
    captioned_motion("fig14", 1e-6),
    *(
        Claim(place(name), "mean motion along OX", partial(mean_motion, name), MOTION, "OY for OX")
        for name in ("fig12", "fig13", "fig14")
    ),
    *(
        Claim(
            place(name),
            "along OY it stays bounded",
            partial(bounded_across, name),
            MOTION,
            "Fig. 14",
        )
        for name in ("fig12", "fig13")
    ),
    Claim("Fig. 14", "along OY its deviation grows", grows_across, "(3.2), 4000 s", "Fig. 13"),
)
