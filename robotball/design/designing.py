"""Design a ball that has requested A, Ω, K and radius, or say why there is none.

The inertia is shared among shell, frame and the fewest rotors: a small convex problem.

Of a body only the second moments of mass count, Σ = ∫ r rᵀ dm = ½ tr(I) E - I. There is such a
body iff Σ is positive (for I: the triangle inequality), and its mass m can lie within r of the
centre iff tr Σ <= m r², by six points at least. With s = d + J_s, a shell of equal moments and
rotors as flat as rings leave the frame

    2 Σ_frame = P - Σ j (E - n nᵀ),    P = tr(A⁻¹) E - 2 A⁻¹ - s E,

and must make h = K + sΩ = Σ j φ̇ n. Let no rate exceed w, g = h/w, T = Σ j. What the rotors give
back, N = Σ j n nᵀ, has the trace T and N >= g gᵀ/T, so the best that they can do is to pour
τ = T - |g|²/T on where Z = P - T E + g gᵀ/T is least. One rotor has T = |g|, τ = 0; two pour it
all on one direction e. A third is of no use: where Z has two negative eigenvalues, their sum and τ
together grow as T falls. All bounds are concave in (s, T), and very nearly so along T = |g(s)|: the
search goes uphill on s, and for each s on T.

Units here: the trace of A⁻¹ is 1 [kg m²], the shell's radius 1 m.

A request may have no ball. With b the eigenvalues of A⁻¹ and d = m a², the inertia A⁻¹ - d E is
that of a body iff d <= Σb - 2 max b (the triangle inequality), and its mass can lie inside the
shell iff d >= Σb/5; so both can be had iff max b <= (2/5) Σb.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from robotball.errors import InputError, check_not_negative, check_positive, check_size
from robotball.robot.ball import ROUNDING, Ball, Frame, Hinge, Rotor, Shell, shell_inertia
from robotball.robot.formulas import Parameters
from robotball.robot.scene import Scene
from robotball.rotations import Array, as_floats

_MOST_ROTORS = 2  # a third one is of no use, as the head of this file shows
# A share that keeps its bounds by less, of the trace of A⁻¹, is refused: rounding would decide.
_LEAST_MARGIN = 1e-9
ROTOR_SHARE = 0.5  # of the margin, spent on a slower rotor
_NO_MOMENTUM = 1e-14  # of the size of K, below which K + sΩ is zero
_ROTOR_RADIUS = 0.6  # of the frame's radius, where no other is given
# A frame that cannot lie within its radius may reach this much farther than it must.
WIDER = 1.1  # the least radius itself leaves the other bounds no margin


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bound the bodies of a design.

    By default the shell is the only bound.

    Attributes
    ----------
    rotor_speed : float, rad/s
        The largest rate of a rotor.
    frame_radius : float or None, m
        The radius within which the frame must lie. If None, it is the inner radius of the shell.
    rotor_radius : float or None, m
        The largest radius of a rotor. If None, it is 0.6 of the frame's.
    shell_mass : float, kg
        The least mass of the shell.
    frame_mass : float, kg
        The least mass of the frame.
    rotor_mass : float, kg
        The least mass of each rotor.
    shell_thickness : float, m
        The thickness of a homogeneous shell. 0 is a thin shell.
    buildable : bool
        Whether a ball with mass beyond `frame_radius` is refused.

    Examples
    --------
    >>> import robotball as rb
    >>> slow = rb.Limits(rotor_speed=50.0)
    >>> found = rb.design(A=[0.7, 0.6, 0.8], Omega=[0, 0, 2], K=[2, 2, 0], radius=1.0, limits=slow)
    >>> max(found.rates[1:]) <= 50.0
    True
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
        """Return the largest of the frame and of the rotors in a shell of `radius` [m]."""
        inner = radius - self.shell_thickness
        frame = inner if self.frame_radius is None else self.frame_radius
        return frame, _ROTOR_RADIUS * frame if self.rotor_radius is None else self.rotor_radius


@dataclass(frozen=True)
class Design:
    """Hold a ball with requested numbers and the rates that it needs.

    Attributes
    ----------
    ball : Ball
        The bodies, with the rates of their hinges.
    limits : Limits
        The limits that the bodies keep.
    masses : (float, float), kg
        The least mass with which all mass can lie inside the shell, and the largest with which the
        inertia is a body's.
    needed_radius : float, m
        The least radius within which the frame can lie, if that is more than the limits allow.
        Otherwise it is the radius that they allow.

    Examples
    --------
    >>> import robotball as rb
    >>> found = rb.design(A=[0.7, 0.6, 0.8], Omega=[0, 0, 2], K=[2, 2, 0], radius=1.0)
    >>> found.buildable, len(found.ball.rotors)
    (True, 1)
    """

    ball: Ball
    limits: Limits
    masses: tuple[float, float]
    needed_radius: float

    @property
    def rates(self) -> tuple[float, ...]:
        """The hinges' rates [rad/s]: the frame's about the shell's axis, then the rotors'."""
        return tuple(cast(float, hinge.command) for hinge in self.ball.hinges)

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
    """Design a ball with requested numbers of the equations, by the fewest rotors.

    The shell's axis is along Omega, or z if Omega is zero. The rotors are rings with Σ j φ̇ n = K +
    (J_s + d)Ω, by (A.3) and K = k - dΩ. There is no rotor if that can be zero, one if the rates
    have no limit, and never more than two. The masses of the bodies are those that keep all bounds
    by the largest margin. A frame inside its radius, or nearly so, goes before fewer rotors.

    Parameters
    ----------
    A : (3,) or (3, 3), 1/(kg m²), frame axes
        The inverse of the inertia about the contact point, or its diagonal.
    Omega : (3,), rad/s, frame axes
        The rate of the frame relative to the shell.
    K : (3,), kg m²/s, frame axes
        The momentum of the parts that turn.
    radius : float, m
        The radius of the shell.
    mass : float, kg, optional
        The mass of the ball. The default is the mass that keeps all bounds by the largest margin.
    limits : Limits, optional
        Bounds on the bodies. By default the shell is the only one.

    Returns
    -------
    Design
        The bodies and their rates.

    Raises
    ------
    InputError
        If there is no such ball. The message has the condition, its value, its limit and the
        difference.

    Examples
    --------
    >>> import robotball as rb
    >>> found = rb.design(A=[0.7, 0.6, 0.8], Omega=[0, 0, 2], K=[2, 2, 0], radius=1.0)
    >>> print(f"{len(found.ball.rotors)} rotor at {found.rates[1]:.1f} rad/s")
    1 rotor at 138.9 rad/s
    """
    limits = Limits() if limits is None else limits
    _check_sizes(radius, mass, limits)
    # An inverse is symmetric to rounding only, and eigvalsh reads one half of a matrix.
    B = np.linalg.inv(_symmetric_positive(A))
    B = (B + B.T) / 2
    Omega, K = _vector("Omega", Omega), _vector("K", K)
    _check_inertia_at(B, radius, mass, limits)
    request = _request(B, Omega, K, radius, mass, limits)
    _check_least_masses(request)
    needed = request.frame_radius
    # A ball that cannot be built can be simulated, unless the limits forbid it. Its frame reaches
    # hardly farther than it must, or else as far as the fewest rotors make it.
    found = share(request, needed)
    if (
        found is None
        and not limits.buildable
        and _largest_margin(request, math.inf) > _LEAST_MARGIN
    ):
        needed = _least_frame_radius(request)
        found = share(request, WIDER * needed) or share(request, math.inf)
    if found is None:
        raise _refusal(request, limits, radius)
    return Design(
        ball=_ball(found, B, Omega, K, radius, limits),
        limits=limits,
        masses=masses_allowed(B, radius),
        needed_radius=radius * needed,
    )


def describe(design: Design) -> str:
    """Return a few lines of text: bodies with masses, sizes and rates, and the verdict."""
    ball, (least, most) = design.ball, design.masses
    shell, frame = ball.shell, ball.frame
    thickness = design.limits.shell_thickness
    kind = f"{thickness:g} m thick" if thickness else "thin"
    moments = ", ".join(f"{moment:.6g}" for moment in np.linalg.eigvalsh(frame.inertia))
    rows = [
        f"ball    radius {ball.radius:g} m, mass {ball.mass:.6g} kg "
        f"(from {least:.6g} kg on all of it fits in the shell; above {most:.6g} kg no body has it)",
        f"shell   mass {shell.mass:.6g} kg, {kind}, axis {_in_digits(shell.axis)}",
        f"frame   mass {frame.mass:.6g} kg, principal moments {moments} kg m², "
        f"within {design.reach:.4g} m, {design.rates[0]:.6g} rad/s",
    ]
    for i, (rotor, rate) in enumerate(zip(ball.rotors, design.rates[1:], strict=True), start=1):
        ring = math.sqrt(rotor.axial_inertia / rotor.mass)
        rows.append(
            f"rotor{i}  mass {rotor.mass:.6g} kg, ring of radius {ring:.4g} m, axis "
            f"{_in_digits(rotor.axis)}, {rate:.6g} rad/s"
        )
    return "\n".join([*rows, design.verdict])


def redesign(
    scene: Scene, mass: float | None, limits: Limits, numbers: Parameters | None = None
) -> tuple[Design, Scene]:
    """Design bodies for the scene's own A, Ω, K and radius. Returns also the scene with them.

    mass: the ball's [kg]; if None, the best one in the rubber model, and the scene's own in the
    classical one, whose (3.3) knows d = m a² beside A, Ω and K. numbers: of another Ω and K for the
    scene's A, in place of its own. The new scene has no motors. Raises
    InputError where the rates are not constant or there is no such ball.
    """
    if mass is None and scene.rolling == "classical":  # another mass would be another motion
        mass = scene.ball.mass
    numbers, axes = numbers or scene.parameters, scene.principal_axes
    found = design(
        scene.ball.A, axes @ numbers.Omega, axes @ numbers.K, scene.ball.radius, mass, limits
    )
    return found, replace(
        scene,
        name=f"{scene.name}_designed",
        title=f"{scene.title}, designed bodies",
        source=f"Bodies designed for the numbers of {scene.name}. {found.verdict}\n{scene.source}",
        ball=found.ball,
    )


def _check_sizes(radius: float, mass: float | None, limits: Limits) -> None:
    """Raise InputError unless radius, mass and limits are numbers that go together."""
    check_positive("radius", radius, "m")
    if mass is not None:
        check_positive("mass", mass, "kg")
    if not limits.rotor_speed > 0:
        raise InputError(f"rotor_speed must be positive, not {limits.rotor_speed:g} rad/s")
    for name in ("shell_mass", "frame_mass", "rotor_mass"):
        check_not_negative(name, getattr(limits, name), "kg")
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


def _symmetric_positive(A: ArrayLike) -> Array:
    matrix = as_floats("A", A)
    if matrix.shape == (3,):
        matrix = np.diag(matrix)
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise InputError(f"A must be 3 or 3 x 3 finite numbers, not {np.asarray(A).tolist()}")
    if np.abs(matrix - matrix.T).max() > ROUNDING * np.abs(matrix).max():
        raise InputError(f"A is not symmetric: {matrix.tolist()}")
    least = float(np.linalg.eigvalsh(matrix)[0])
    if not least > 0:
        raise InputError(f"A is not positive: its least eigenvalue is {least:.6g} 1/(kg m²)")
    # Positive is not enough: products of a few of these must not overflow.
    for value in (least, float(np.abs(matrix).max())):
        check_positive("A", value, "1/(kg m²)")
    return matrix


def _vector(name: str, v: ArrayLike) -> Array:
    vector = as_floats(name, v, (3,))
    for value in vector.tolist():
        check_size(name, value)
    return vector


def masses_allowed(B: Array, radius: float) -> tuple[float, float]:
    """Return Σb/5a² and (Σb - 2 max b)/a² [kg], for B = A⁻¹ (3, 3) [kg m²], radius a [m].

    From the first on all mass can lie inside the shell; beyond the second no body has the inertia.
    Where the first exceeds the second no workshop can build the ball.
    """
    b = np.linalg.eigvalsh(B)
    return float(b.sum()) / 5 / radius**2, float(b.sum() - 2 * b[-1]) / radius**2


def _check_inertia_at(B: Array, radius: float, mass: float | None, limits: Limits) -> None:
    """Raise InputError where no body has B = A⁻¹ (3, 3) [kg m²], whatever the shares."""
    b = np.linalg.eigvalsh(B)
    least, most = masses_allowed(B, radius)
    if not most * radius**2 > _LEAST_MARGIN * b.sum():
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


@dataclass(frozen=True)
class _DesignRequest:
    """The numbers of the equations and the bounds on the bodies, in this file's units.

    unit is the mass that is 1 here [kg]; B (3, 3) is A⁻¹; d is None where the mass is free;
    shell_factor is J_s/(m_s a²); speed is the rotors' largest rate; shell, frame and rotor are the
    least masses of each.
    """

    unit: float
    B: Array
    K: Array
    Omega: Array
    d: float | None
    shell_factor: float
    speed: float
    shell: float
    frame: float
    rotor: float
    frame_radius: float
    rotor_radius: float

    @property
    def largest_s(self) -> float:
        """Where P ceases to be positive: tr(A⁻¹) - 2 max b."""
        return float(1 - 2 * np.linalg.eigvalsh(self.B)[-1])

    @property
    def smallest_s(self) -> float:
        """d + J_s of the lightest shell, alone where the mass is free."""
        J_s = self.shell_factor * self.shell
        return J_s + (self.shell if self.d is None else self.d)

    def momentum(self, s: Array) -> Array:
        """Return h = K + sΩ (..., 3) of the rotors, for s (...)."""
        return self.K + s[..., None] * self.Omega

    @property
    def s_without_rotors(self) -> tuple[float, float] | None:
        """Between which s the momentum h is zero, if it is anywhere."""
        if not np.any(self.Omega):
            return None if np.any(self.K) else (self.smallest_s, self.largest_s)
        s = float(-self.K @ self.Omega / (self.Omega @ self.Omega))
        size = float(np.linalg.norm(self.K)) + s * float(np.linalg.norm(self.Omega))
        still = np.linalg.norm(self.momentum(np.array(s))) <= _NO_MOMENTUM * size
        return (s, s) if still and self.smallest_s <= s <= self.largest_s else None


def _request(
    B: Array, Omega: Array, K: Array, radius: float, mass: float | None, limits: Limits
) -> _DesignRequest:
    """Return the request in this file's units."""
    trace = float(np.trace(B))
    unit = trace / radius**2  # kg
    frame_radius, rotor_radius = limits.radii(radius)
    return _DesignRequest(
        unit=unit,
        B=B / trace,
        K=K / trace,
        Omega=Omega,
        d=None if mass is None else mass / unit,
        shell_factor=shell_inertia(1.0, 1.0, limits.shell_thickness / radius),
        speed=limits.rotor_speed,
        shell=limits.shell_mass / unit,
        frame=limits.frame_mass / unit,
        rotor=limits.rotor_mass / unit,
        frame_radius=frame_radius / radius,
        rotor_radius=rotor_radius / radius,
    )


def _check_least_masses(request: _DesignRequest) -> None:
    """Raise InputError where the least masses are too large."""
    unit = request.unit
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


@dataclass(frozen=True)
class _Share:
    """Masses, and the rings' axial inertias (n,) and axes (n, 3).

    margin is how far every bound is kept, of the trace of A⁻¹.
    """

    margin: float
    shell_mass: float
    frame_mass: float
    rotor_masses: Array
    axial_inertias: Array
    axes: Array


def share(request: _DesignRequest, frame_radius: float) -> _Share | None:
    """Return the share with the fewest rotors whose frame lies within `frame_radius`, or None.

    Among those of as many rotors it is the one that keeps all bounds by the largest margin.
    """
    for n in _rotor_counts(request):
        s, T, margin = _best(request, n, frame_radius)
        if margin > _LEAST_MARGIN:
            return _bodies(request, n, s, T, margin)
    return None


def _rotor_counts(request: _DesignRequest) -> range:
    # None first, as fewer are preferred. Rates without a bound make any rotor light enough: a
    # second one could not help.
    return range(2 if np.isinf(request.speed) else 1 + _MOST_ROTORS)


def _best(request: _DesignRequest, n: int, frame_radius: float) -> tuple[float, float, float]:
    """Return s, T and the margin of the best share with n rotors."""
    ends = (request.smallest_s, request.largest_s) if n else request.s_without_rotors
    if ends is None or ends[0] > ends[1]:
        return 0.0, 0.0, -np.inf

    def best_T(s: Array) -> Array:
        g = np.linalg.norm(request.momentum(s), axis=-1) / request.speed
        if n < 2:
            return n * g
        most = np.maximum((1 - 3 * s) / 2, g)  # then the frame is nothing: tr(2 Σ) = tr P - 2T
        return _peak(lambda T: _margin(request, n, frame_radius, s[..., None], T), g, most, 9, 7)

    def margin(s: Array) -> Array:
        return _margin(request, n, frame_radius, s, best_T(s))

    s = _peak(margin, np.array(ends[0]), np.array(ends[1]), 25, 6)
    return float(s), float(best_T(s)), float(margin(s))


def _peak(f: Callable[[Array], Array], low: Array, high: Array, points: int, rounds: int) -> Array:
    """Return where the concave f, (..., points) to the same, is largest from low to high (...)."""
    # Each round narrows the range to 2/(points - 1) of it: 25 points and 6 rounds to 3e-7, 9 and 7
    # to 6e-5. Plain grids, not a scalar search, because all s of a round are searched in T at once.
    u = np.linspace(0.0, 1.0, points)
    for _ in range(rounds):
        at = low[..., None] + (high - low)[..., None] * u
        best = f(at).argmax(axis=-1)[..., None]
        low, peak, high = (
            np.take_along_axis(at, np.clip(best + step, 0, points - 1), axis=-1)[..., 0]
            for step in (-1, 0, 1)
        )
    return peak


def _margin(request: _DesignRequest, n: int, frame_radius: float, s: Array, T: Array) -> Array:
    """Return by how much all bounds are kept (...) at s and T (...), positive iff they are.

    The largest t with 2 Σ_frame >= t E, m_frame >= least + t, m_frame r² - tr Σ_frame >= t,
    m_shell >= least + t, and a single rotor's inertia larger by t ROTOR_SHARE than it must be.
    Each of `bounds` is one of these, linear in t, solved for t.
    """
    c, slower = request.shell_factor, ROTOR_SHARE if n == 1 else 0.0
    Z, tau = _Z(request, *np.broadcast_arrays(s, T))
    z = np.linalg.eigvalsh(Z)
    # Two rings pour τ on the direction in which Z is least; then the next one may be the least.
    flattest = z[..., 0] if n < 2 else np.minimum(z[..., 0] + tau, z[..., 1])
    bounds = [flattest / (1 + slower)]
    if request.d is None:
        # The shell has its least mass and t.
        others, others_per_t = s - (1 + c) * request.shell, 1 + c
    else:
        shell = (s - request.d) / c
        others, others_per_t = request.d - shell, 0.0
        bounds.append(shell - request.shell)
    trace = (1 - 3 * s) / 2 - T  # of Σ_frame: tr P is 1 - 3s, and a ring takes 2j of tr 2Σ
    # A bound is kept by t where its left side less its growth with t is at least t: hence the
    # divisors 1 + growth.
    # Of the rotors' mass by their inertia and by their least masses, with the growth of each; for
    # two the first is too large by no more than one's least mass.
    by_inertia = T / request.rotor_radius**2 + (n - 1) * request.rotor
    least = np.asarray(n * request.rotor)
    for rotors, per_t in ((by_inertia, slower / request.rotor_radius**2), (least, 0.0)):
        frame, frame_per_t = others - rotors, others_per_t + per_t
        bounds.append((frame - request.frame) / (1 + frame_per_t))
        if np.isfinite(frame_radius):
            room = frame_radius**2 * frame - trace
            bounds.append(room / (1 + frame_radius**2 * frame_per_t - slower))
    return np.min(np.broadcast_arrays(*bounds), axis=0)


def _Z(request: _DesignRequest, s: Array, T: Array) -> tuple[Array, Array]:
    """Return Z = P - T E + g gᵀ/T (..., 3, 3) and τ = T - |g|²/T (...)."""
    g = request.momentum(s) / request.speed
    # Without a rotor T is 0; the momentum is rounding then, and nothing gives any back.
    per_T = np.divide(1.0, T, out=np.zeros_like(T), where=T > 0)
    given_back = per_T[..., None, None] * g[..., :, None] * g[..., None, :]
    P_less_T = (1 - s - T)[..., None, None] * np.eye(3) - 2 * request.B
    return P_less_T + given_back, T - per_T * (g * g).sum(axis=-1)


def _bodies(request: _DesignRequest, n: int, s: float, T: float, margin: float) -> _Share:
    if request.d is None:
        shell = request.shell + margin
        d = s - request.shell_factor * shell
    else:
        d = request.d
        shell = (s - d) / request.shell_factor
    inertias, axes = _rings(request, n, s, T, margin)
    masses = np.maximum(inertias / request.rotor_radius**2, request.rotor)
    return _Share(margin, shell, float(d - shell - masses.sum()), masses, inertias, axes)


def _rings(
    request: _DesignRequest, n: int, s: float, T: float, margin: float
) -> tuple[Array, Array]:
    """Return axial inertias (n,) and axes (n, 3) of the rotors."""
    if n == 0:
        return np.empty(0), np.empty((0, 3))
    h = request.momentum(np.array(s))
    if n == 1:
        return np.array([T + ROTOR_SHARE * margin]), h[None] / np.linalg.norm(h)
    Z, tau = _Z(request, np.array(s), np.array(T))
    j_n = _two_rings(T, h / request.speed, np.linalg.eigh(Z)[1][:, 0], float(tau))
    inertias = np.linalg.norm(j_n, axis=1)
    return inertias, j_n / inertias[:, None]


def _two_rings(T: float, g: Array, e: Array, tau: float) -> Array:
    """Return j n (2, 3) of two rotors: Σ j = T, Σ j n = g, Σ j n nᵀ = g gᵀ/T + τ e eᵀ.

    g (3,) and a unit vector e (3,), with τ = T - |g|²/T > 0. The rows (√T, g/√T) and (0, √τ e)
    have the right moments of (1, n), and any rotation of the two rows into each other keeps them;
    this one makes them (√j, √j n) with unit vectors n.
    """
    # e and -e give the same moments; with g·e >= 0 the sum below does not cancel.
    e = np.copysign(1.0, g @ e) * e
    tangent = g @ e / np.sqrt(T * tau)
    x = 1 / (tangent + np.hypot(tangent, 1.0))  # tan of the angle; hypot - tangent would cancel
    across = x * np.sqrt(T * tau) * e
    return np.array([g + across, x * x * g - across]) / (1 + x * x)


def _refusal(request: _DesignRequest, limits: Limits, radius: float) -> InputError:
    """Return why there is no share, though neither inertia nor least masses forbid one."""
    # Each condition is lifted in turn; the one without which there is a share is the reason.
    within = request.frame_radius if limits.buildable else math.inf
    any_speed = replace(request, speed=math.inf)
    if _largest_margin(any_speed, within) > _LEAST_MARGIN:
        needed = _least(
            lambda speed: _largest_margin(replace(request, speed=speed), within), request.speed
        )
        return InputError(
            f"rotor speed: at most {request.speed:.6g} rad/s is allowed, and the momentum "
            f"K + (J_s + d)Ω needs {needed:.4g} rad/s: {needed - request.speed:.4g} rad/s more"
        )
    if limits.buildable and _largest_margin(any_speed, math.inf) > _LEAST_MARGIN:
        needed = radius * _least_frame_radius(any_speed)
        allowed = radius * request.frame_radius
        return InputError(
            f"mass inside the shell: the frame may reach {allowed:.6g} m, and within the limits it "
            f"needs {needed:.4g} m: {needed - allowed:.4g} m more"
        )
    margin, least = request.unit * _largest_margin(any_speed, within), request.unit * _LEAST_MARGIN
    return InputError(
        f"masses: inertia and least masses leave a margin of {margin:.3g} kg, less than the "
        f"{least:.3g} kg that rounding needs"
    )


def _largest_margin(request: _DesignRequest, frame_radius: float) -> float:
    """Return how far a share can keep all bounds, of the trace of A⁻¹; negative if none can."""
    return max(_best(request, n, frame_radius)[2] for n in _rotor_counts(request))


def _least_frame_radius(request: _DesignRequest) -> float:
    """Return the least radius within which the frame of some share can lie."""
    return _least(lambda radius: _largest_margin(request, radius), request.frame_radius)


def _least(largest_margin: Callable[[float], float], too_small: float) -> float:
    """Return the least bound with which there is a share, to four digits.

    There must be one with some bound, and none with one that is too small.
    """

    # In 1/bound, of which no bound is 0, so that the search has two finite ends.
    def margin(per_bound: float) -> float:
        return largest_margin(1 / per_bound if per_bound else math.inf) - _LEAST_MARGIN

    return float(1 / brentq(margin, 0.0, 1 / too_small, rtol=1e-4, xtol=1e-4 / too_small))


def _ball(found: _Share, B: Array, Omega: Array, K: Array, radius: float, limits: Limits) -> Ball:
    """Return the ball of a share in SI units, the frame with what is left, as it turns."""
    trace = float(np.trace(B))
    unit = trace / radius**2  # kg
    shell_mass, frame_mass = unit * found.shell_mass, unit * found.frame_mass
    J_s = shell_inertia(radius, shell_mass, limits.shell_thickness)
    turning = float(np.linalg.norm(Omega))
    axis = Omega / turning if turning else np.array([0.0, 0.0, 1.0])
    shell = Shell(radius, shell_mass, J_s, J_s, axis)
    rotors = tuple(
        Rotor(float(unit * m), float(trace * j), float(trace * j) / 2, n)
        for m, j, n in zip(found.rotor_masses, found.axial_inertias, found.axes, strict=True)
    )
    # The frame takes what rounding leaves, so that the whole ball has the requested numbers.
    d = (shell_mass + frame_mass + sum(rotor.mass for rotor in rotors)) * radius**2
    others = shell.inertia + sum((rotor.inertia for rotor in rotors), np.zeros((3, 3)))
    frame = Frame(frame_mass, B - d * np.eye(3) - others)
    rates = [limits.rotor_speed] * len(rotors)  # two both turn at the largest rate
    if len(rotors) == 1:
        h = K + (J_s + d) * Omega
        rates = [float(np.linalg.norm(h)) / rotors[0].axial_inertia]
    return Ball(shell, (Hinge(frame, turning), *map(Hinge, rotors, rates)))


def _in_digits(v: Array) -> str:
    return f"({v[0]:.6g}, {v[1]:.6g}, {v[2]:.6g})"
