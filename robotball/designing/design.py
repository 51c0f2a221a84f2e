"""Requested A, Ω, K and radius → a Ball that has them, or why there is none."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from robotball.bodies import (
    ROUNDING,
    Ball,
    Frame,
    Rotor,
    Shell,
    thick_shell_inertia,
    thin_shell_inertia,
)
from robotball.designing.decompose import (
    LEAST_MARGIN,
    DesignRequest,
    Share,
    largest_margin,
    least_frame_radius,
    share,
)
from robotball.designing.feasibility import (
    Limits,
    check_inertia_at,
    check_least_masses,
    check_sizes,
    masses_allowed,
    refusal,
)
from robotball.errors import InputError, check_positive, check_size
from robotball.rotations import Array
from robotball.scene import Scene

# A frame that cannot lie within its radius may reach this much farther than it must.
WIDER = 1.1


@dataclass(frozen=True)
class Design:
    """A ball with the requested numbers, the rates that it needs, and whether it can be built.

    frame_rate rad/s, about the shell's axis; rotor_rates (rotors,) rad/s; limits, those that it
    keeps. masses kg: with the first and more all mass can lie inside the shell, with less than the
    second the inertia is a body's. needed_radius m: the least within which the frame can lie, where
    that is more than the limits allow; else what they allow.
    """

    ball: Ball
    frame_rate: float
    rotor_rates: tuple[float, ...]
    limits: Limits
    masses: tuple[float, float]
    needed_radius: float

    @property
    def reach(self) -> float:
        """√(tr Σ/m) of the frame [m]: its mass can lie within it, and within nothing less."""
        frame = self.ball.frame
        return math.sqrt(float(np.trace(frame.inertia)) / 2 / frame.mass)

    @property
    def buildable(self) -> bool:
        """Whether the frame lies within what the limits, or the shell, leave it."""
        return self.reach <= self.allowed_radius * (1 + ROUNDING)

    @property
    def allowed_radius(self) -> float:
        """The limit of the frame's radius, or the shell's inner radius [m]."""
        return self.limits.radii(self.ball.radius)[0]

    @property
    def verdict(self) -> str:
        """One line: whether it can be built, and if not, the radius that it would need."""
        if self.buildable:
            return (
                "can be built: mass lies inside the shell, the frame's within "
                f"{self.reach:.4g} m, of {self.allowed_radius:.4g} m"
            )
        inside = self.needed_radius <= self.ball.radius - self.limits.shell_thickness
        place = "the frame's radius" if inside else "the shell"
        return (
            f"can be simulated, not be built: mass would lie outside {place}: the frame needs a "
            f"radius of {self.needed_radius:.4g} m ({self.reach:.4g} m here), and has "
            f"{self.allowed_radius:.4g} m"
        )


def design(
    A: ArrayLike,
    Omega: ArrayLike,
    K: ArrayLike,
    radius: float,
    mass: float | None = None,
    limits: Limits | None = None,
) -> Design:
    """A ball with the requested numbers of the equations, by the fewest rotors.

    A: (3,) its diagonal or (3, 3), in the frame's axes, 1/(kg m²); Omega (3,) rad/s and K (3,)
    kg m²/s in the same axes; radius m; mass kg. The shell's axis is along Omega, or z where that is
    zero. The rotors are rings with Σ j φ̇ n = K + (J_s + d)Ω, by (A.3) and K = k - dΩ: none where
    that can be zero, one where their rates have no limit, and never more than two.

    The masses of the bodies, and the ball's where it is None, are those that keep all bounds by the
    largest margin. A frame inside its radius, or nearly so, goes before fewer rotors. Raises
    InputError where there is no ball, with the condition, its value, its limit and the difference.
    """
    limits = Limits() if limits is None else limits
    check_sizes(radius, mass, limits)
    B = np.linalg.inv(_symmetric_positive(A))
    B = (B + B.T) / 2
    Omega, K = _vector("Omega", Omega), _vector("K", K)
    check_inertia_at(B, radius, mass, limits)
    unit = float(np.trace(B)) / radius**2  # kg
    request = _request(B, Omega, K, radius, mass, limits)
    check_least_masses(request, unit)
    needed = request.frame_radius
    found = share(request, needed)
    if found is None and not limits.buildable and largest_margin(request, math.inf) > LEAST_MARGIN:
        needed = least_frame_radius(request)
        found = share(request, WIDER * needed) or share(request, math.inf)
    if found is None:
        raise refusal(request, limits, radius, unit)
    ball, rates = _ball(found, B, Omega, K, radius, limits)
    return Design(
        ball=ball,
        frame_rate=float(np.linalg.norm(Omega)),
        rotor_rates=rates,
        limits=limits,
        masses=masses_allowed(B, radius),
        needed_radius=radius * needed,
    )


def describe(design: Design) -> str:
    """Bodies with their masses, sizes and rates, and the verdict: a few lines of text."""
    ball, (least, most) = design.ball, design.masses
    shell, frame = ball.shell, ball.frame
    thickness = design.limits.shell_thickness
    kind = f"{thickness:g} m thick" if thickness else "thin"
    moments = ", ".join(f"{moment:.6g}" for moment in np.linalg.eigvalsh(frame.inertia))
    rows = [
        f"ball    radius {ball.radius:g} m, mass {ball.mass:.6g} kg "
        f"(inside the shell from {least:.6g} kg on, a body's up to {most:.6g} kg)",
        f"shell   mass {shell.mass:.6g} kg, {kind}, axis {_text(shell.axis)}",
        f"frame   mass {frame.mass:.6g} kg, principal moments {moments} kg m², "
        f"within {design.reach:.4g} m, {design.frame_rate:.6g} rad/s",
    ]
    for i, (rotor, rate) in enumerate(zip(ball.rotors, design.rotor_rates, strict=True), start=1):
        ring = math.sqrt(rotor.axial_inertia / rotor.mass)
        rows.append(
            f"rotor{i}  mass {rotor.mass:.6g} kg, ring of radius {ring:.4g} m, axis "
            f"{_text(rotor.axis)}, {rate:.6g} rad/s"
        )
    return "\n".join([*rows, design.verdict])


def _text(v: Array) -> str:
    return f"({v[0]:.6g}, {v[1]:.6g}, {v[2]:.6g})"


def _symmetric_positive(A: ArrayLike) -> Array:
    matrix = np.asarray(A, dtype=float)
    if matrix.shape == (3,):
        matrix = np.diag(matrix)
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise InputError(f"A must be 3 or 3 x 3 finite numbers, not {np.asarray(A).tolist()}")
    if np.abs(matrix - matrix.T).max() > ROUNDING * np.abs(matrix).max():
        raise InputError(f"A is not symmetric: {matrix.tolist()}")
    least = float(np.linalg.eigvalsh(matrix)[0])
    if not least > 0:
        raise InputError(f"A is not positive: its least eigenvalue is {least:.6g} 1/(kg m²)")
    for value in (least, float(np.abs(matrix).max())):
        check_positive("A", value, "1/(kg m²)")
    return matrix


def _vector(name: str, v: ArrayLike) -> Array:
    vector = np.asarray(v, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise InputError(f"{name} must be 3 finite numbers, not {np.asarray(v).tolist()}")
    for value in vector.tolist():
        check_size(name, value)
    return vector


def _request(
    B: Array, Omega: Array, K: Array, radius: float, mass: float | None, limits: Limits
) -> DesignRequest:
    """The request in the units of decompose.py."""
    trace = float(np.trace(B))
    unit = trace / radius**2  # kg
    frame_radius, rotor_radius = limits.radii(radius)
    return DesignRequest(
        B=B / trace,
        K=K / trace,
        Omega=Omega,
        d=None if mass is None else mass / unit,
        shell_factor=_shell_inertia(1.0, 1.0, limits.shell_thickness / radius),
        speed=limits.rotor_speed,
        shell=limits.shell_mass / unit,
        frame=limits.frame_mass / unit,
        rotor=limits.rotor_mass / unit,
        frame_radius=frame_radius / radius,
        rotor_radius=rotor_radius / radius,
    )


def _shell_inertia(radius: float, mass: float, thickness: float) -> float:
    if thickness == 0:
        return thin_shell_inertia(radius, mass)
    return thick_shell_inertia(radius, mass, thickness)


def _ball(
    found: Share, B: Array, Omega: Array, K: Array, radius: float, limits: Limits
) -> tuple[Ball, tuple[float, ...]]:
    """The bodies of a share in SI units, the frame with what the others leave; rotor rates."""
    trace = float(np.trace(B))
    unit = trace / radius**2  # kg
    shell_mass, frame_mass = unit * found.shell_mass, unit * found.frame_mass
    J_s = _shell_inertia(radius, shell_mass, limits.shell_thickness)
    turning = float(np.linalg.norm(Omega))
    axis = Omega / turning if turning else np.array([0.0, 0.0, 1.0])
    shell = Shell(radius, shell_mass, J_s, J_s, axis)
    rotors = tuple(
        Rotor(float(unit * m), float(trace * j), float(trace * j) / 2, n)
        for m, j, n in zip(found.rotor_masses, found.axial_inertias, found.axes, strict=True)
    )
    d = (shell_mass + frame_mass + sum(rotor.mass for rotor in rotors)) * radius**2
    others = shell.inertia + sum((rotor.inertia for rotor in rotors), np.zeros((3, 3)))
    ball = Ball(shell, Frame(frame_mass, B - d * np.eye(3) - others), rotors)
    if len(rotors) != 1:  # two both turn at the largest rate
        return ball, (limits.rotor_speed,) * len(rotors)
    h = K + (J_s + d) * Omega
    return ball, (float(np.linalg.norm(h)) / rotors[0].axial_inertia,)


def redesign(scene: Scene, mass: float | None, limits: Limits) -> tuple[Design, Scene]:
    """The design for the scene's own A, Ω, K and radius, and the scene with its bodies.

    mass: the ball's [kg]; if None, the best one in the rubber model, and the scene's own in the
    classical one, whose (3.3) knows d = m a² beside A, Ω and K. The new scene has no motors. Raises
    InputError where the rates are not constant or there is no such ball.
    """
    if mass is None and scene.rolling == "classical":
        mass = scene.ball.mass
    numbers, axes = scene.parameters, scene.principal_axes
    found = design(
        scene.ball.A, axes @ numbers.Omega, axes @ numbers.K, scene.ball.radius, mass, limits
    )
    return found, replace(
        scene,
        name=f"{scene.name}_designed",
        title=f"{scene.title}, designed bodies",
        source=f"Bodies designed for the numbers of {scene.name}. {found.verdict}\n{scene.source}",
        ball=found.ball,
        frame_rate=found.frame_rate,
        rotor_rates=found.rotor_rates,
        motors=(),
    )
