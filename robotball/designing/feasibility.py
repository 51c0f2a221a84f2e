"""The limits of a design, and the reasons for which there is no ball.

With b the eigenvalues of A⁻¹ and d = m a², the inertia A⁻¹ - d E is that of a body iff
d <= Σb - 2 max b (the triangle inequality), and its mass can lie inside the shell iff
d >= Σb/5; so both can be had iff max b <= (2/5) Σb.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from robotball.designing.decompose import (
    LEAST_MARGIN,
    DesignRequest,
    largest_margin,
    least_frame_radius,
    least_speed,
)
from robotball.errors import InputError, check_positive
from robotball.rotations import Array

ROTOR_RADIUS = 0.6  # of the frame's radius, where no other is given


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bounds on the bodies of a design; by default there is none but the shell. SI units.

    rotor_speed rad/s, the largest; frame_radius m, within which the frame must lie (None: inside
    the shell); rotor_radius m, the rotors' largest (None: 0.6 of the frame's); shell_mass,
    frame_mass, rotor_mass kg, the least, of each rotor; shell_thickness m, of a homogeneous shell
    (0: thin). buildable = True refuses a ball with mass beyond frame_radius.
    """

    rotor_speed: float = math.inf
    frame_radius: float | None = None
    rotor_radius: float | None = None
    shell_mass: float = 0.0
    frame_mass: float = 0.0
    rotor_mass: float = 0.0
    shell_thickness: float = 0.0
    buildable: bool = False

    def radii(self, radius: float) -> tuple[float, float]:
        """The largest of the frame and of the rotors in a shell of `radius` [m]."""
        inner = radius - self.shell_thickness
        frame = inner if self.frame_radius is None else self.frame_radius
        return frame, ROTOR_RADIUS * frame if self.rotor_radius is None else self.rotor_radius


def masses_allowed(B: Array, radius: float) -> tuple[float, float]:
    """Σb/5a² and (Σb - 2 max b)/a² [kg], for B = A⁻¹ (3, 3) [kg m²] and the radius a [m].

    From the first on all mass can lie inside the shell; beyond the second no body has the inertia.
    Where the first exceeds the second no workshop can build the ball.
    """
    b = np.linalg.eigvalsh(B)
    return float(b.sum()) / 5 / radius**2, float(b.sum() - 2 * b[-1]) / radius**2


def check_sizes(radius: float, mass: float | None, limits: Limits) -> None:
    """Raises InputError unless radius, mass and limits are numbers that go together."""
    check_positive("radius", radius, "m")
    if mass is not None:
        check_positive("mass", mass, "kg")
    if not limits.rotor_speed > 0:
        raise InputError(f"rotor_speed must be positive, not {limits.rotor_speed:g} rad/s")
    for name in ("shell_mass", "frame_mass", "rotor_mass"):
        value = getattr(limits, name)
        if not (math.isfinite(value) and value >= 0):
            raise InputError(f"{name} must be finite and not negative, not {value:g} kg")
    if not 0 <= limits.shell_thickness < radius:
        raise InputError(
            f"shell_thickness must be at least 0 and less than the radius {radius:g} m, not "
            f"{limits.shell_thickness:g} m"
        )
    frame, rotor = limits.radii(radius)
    for name, value, most in (
        ("frame_radius", frame, radius - limits.shell_thickness),
        ("rotor_radius", rotor, frame),
    ):
        if not 0 < value <= most:
            raise InputError(f"{name} must be positive and at most {most:g} m, not {value:g} m")


def check_inertia_at(B: Array, radius: float, mass: float | None, limits: Limits) -> None:
    """Raises InputError where no body has B = A⁻¹ (3, 3) [kg m²], whatever the bodies' shares."""
    b = np.linalg.eigvalsh(B)
    least, most = masses_allowed(B, radius)
    if not most * radius**2 > LEAST_MARGIN * b.sum():
        raise InputError(
            f"triangle inequality: the largest eigenvalue of 1/A, {b[2]:.6g} kg m², must be less "
            f"than the sum of the others, {b[0] + b[1]:.6g} kg m²; it is "
            f"{b[2] - b[0] - b[1]:.6g} kg m² too large, whatever the mass"
        )
    if mass is not None and not mass < most:
        moment, excess = b[0] - mass * radius**2, mass - most
        fault = (
            f"triangle inequality: 1/A - m a² breaks it by {excess * radius**2:.6g} kg m²"
            if moment > 0
            else f"inertia not positive: 1/A - m a² has the principal moment {moment:.6g} kg m²"
        )
        raise InputError(
            f"{fault} with m = {mass:.6g} kg; m must be less than {most:.6g} kg, "
            f"{excess:.6g} kg less"
        )
    heaviest = most if mass is None else mass
    if limits.buildable and not heaviest > least:
        raise InputError(
            f"mass inside the shell: m must be at least tr(1/A)/(5 a²) = {least:.6g} kg, and is "
            f"{heaviest:.6g} kg{' at most' if mass is None else ''}: {least - heaviest:.6g} kg too "
            "little"
        )


def check_least_masses(request: DesignRequest, unit: float) -> None:
    """Raises InputError where the least masses are too large; unit: kg in one of `request`'s."""
    rotors = 0.0 if request.s_without_rotors else request.rotor
    together = request.shell + request.frame + rotors
    if request.d is not None and not together < request.d:
        raise InputError(
            f"masses: the least of shell, frame and rotor are {together * unit:.6g} kg together, "
            f"and the ball is to have {request.d * unit:.6g} kg: "
            f"{(together - request.d) * unit:.6g} kg too much"
        )
    J_s = request.shell_factor * request.shell
    s = J_s + (together if request.d is None else request.d)
    if not s < request.largest_s:
        raise InputError(
            f"masses: with the least of shell, frame and rotor, {together * unit:.6g} kg, "
            f"m + J_s/a² is {s * unit:.6g} kg at least; for the triangle inequality of what the "
            f"shell leaves it must be less than {request.largest_s * unit:.6g} kg: "
            f"{(s - request.largest_s) * unit:.6g} kg too much"
        )


def refusal(request: DesignRequest, limits: Limits, radius: float, unit: float) -> InputError:
    """Why there is no share, though neither the inertia nor the least masses forbid one."""
    within = request.frame_radius if limits.buildable else math.inf
    any_speed = replace(request, speed=math.inf)
    if largest_margin(any_speed, within) > LEAST_MARGIN:
        needed = least_speed(request, within)
        return InputError(
            f"rotor speed: at most {request.speed:.6g} rad/s is allowed, and the momentum "
            f"K + (J_s + d)Ω needs {needed:.4g} rad/s: {needed - request.speed:.4g} rad/s more"
        )
    if limits.buildable and largest_margin(any_speed, math.inf) > LEAST_MARGIN:
        needed = radius * least_frame_radius(any_speed)
        allowed = radius * request.frame_radius
        return InputError(
            f"mass inside the shell: the frame may reach {allowed:.6g} m, and within the limits it "
            f"needs {needed:.4g} m: {needed - allowed:.4g} m more"
        )
    margin = largest_margin(any_speed, within)
    return InputError(
        f"masses: inertia and least masses leave a margin of {margin * unit:.3g} kg, less than the "
        f"{LEAST_MARGIN * unit:.3g} kg that rounding needs"
    )
