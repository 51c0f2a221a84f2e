"""Design a ball with the requested A, Ω, K and radius, or report why none exists.

The inertia is divided between the shell, the frame and as few rotors as possible. This is a small
convex problem.

A body enters the equations only through the second moments of its mass, Σ = ∫ r rᵀ dm =
½ tr(I) E - I. A body with Σ exists iff Σ is positive (for I: the triangle inequality), and its mass
m fits within the radius r iff tr Σ <= m r². Let the shell have equal moments J_s and let the rotors
be flat rings with axial inertias j, axes n and rates φ̇. With s = d + J_s, the frame then gets

    2 Σ_frame = P - Σ j (E - n nᵀ),    P = tr(A⁻¹) E - 2 A⁻¹ - s E,

and the rotors must provide h = K + sΩ = Σ j φ̇ n. Let w be the largest rate, g = h/w and T = Σ j.
The rotors contribute N = Σ j n nᵀ to 2 Σ_frame, with trace T and N >= g gᵀ/T. At best, they add
τ = T - |g|²/T in the direction in which Z = P - T E + g gᵀ/T is smallest. One rotor has T = |g| and
τ = 0; two rotors can add all of τ in one direction e. A third rotor is useless: if Z has two
negative eigenvalues, their sum plus τ increases as T decreases. All bounds are concave in (s, T),
and almost concave along T = |g(s)|. So s is found by an ascent, with an ascent in T for each s.

Units in this file: tr(A⁻¹) = 1 [kg m²], shell radius = 1 m.

For some A no ball exists. Let b be the eigenvalues of A⁻¹ and d = m a². The inertia A⁻¹ - d E
belongs to a body iff d <= Σb - 2 max b (triangle inequality), and the body's mass fits inside the
shell iff d >= Σb/5. A mass can satisfy the two conditions iff max b <= (2/5) Σb.
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

_MOST_ROTORS = 2  # a third is useless; see the docstring of this file
# Margin, relative to tr(A⁻¹), below which a design is refused because rounding would decide.
_LEAST_MARGIN = 1e-9
ROTOR_SHARE = 0.5  # fraction of the margin by which a single rotor is made larger and slower
_NO_MOMENTUM = 1e-14  # relative to K: a smaller K + sΩ is zero
_ROTOR_RADIUS = 0.6  # default, in frame radii
# Radius allowed to a frame that does not fit, divided by the least possible radius. The least
# radius itself would leave no margin for the other bounds.
WIDER = 1.1


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Set bounds on the bodies of a design. By default, the shell's size is the only bound.

    Attributes
    ----------
    rotor_speed : float, rad/s
        The largest rate of a rotor.
    frame_radius : float or None, m
        The radius within which the frame must fit. By default the inner radius of the shell.
    rotor_radius : float or None, m
        The largest radius of a rotor. By default 0.6 times the radius for the frame.
    shell_mass : float, kg
        The least mass of the shell.
    frame_mass : float, kg
        The least mass of the frame.
    rotor_mass : float, kg
        The least mass of each rotor.
    shell_thickness : float, m
        The thickness of a homogeneous shell. A thickness of 0 means a thin shell.
    buildable : bool
        True to refuse a ball whose frame needs mass outside `frame_radius`.

    Examples
    --------
    >>> import robotball as rb
    >>> slow = rb.Limits(rotor_speed=50.0)
    >>> result = rb.design(A=[0.7, 0.6, 0.8], Omega=[0, 0, 2], K=[2, 2, 0], radius=1.0, limits=slow)
    >>> max(result.rates[1:]) <= 50.0
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
        """Return the largest radii of frame and rotors in a shell of `radius` [m]."""
        inner = radius - self.shell_thickness
        frame = inner if self.frame_radius is None else self.frame_radius
        return frame, _ROTOR_RADIUS * frame if self.rotor_radius is None else self.rotor_radius


@dataclass(frozen=True)
class Design:
    """Hold a ball with the requested A, Ω and K and the hinge rates that it needs.

    Attributes
    ----------
    ball : Ball
        The bodies, with the rates of their hinges.
    limits : Limits
        The limits that the bodies satisfy.
    masses : (float, float), kg
        The least mass of the ball with which all mass fits inside the shell, and the largest mass
        of the ball with which its inertia is physical.
    needed_radius : float, m
        The allowed radius if the frame fits within it, otherwise the least radius within which the
        frame fits.

    Examples
    --------
    >>> import robotball as rb
    >>> result = rb.design(A=[0.7, 0.6, 0.8], Omega=[0, 0, 2], K=[2, 2, 0], radius=1.0)
    >>> result.buildable, len(result.ball.rotors)
    (True, 1)
    """

    ball: Ball
    limits: Limits
    masses: tuple[float, float]
    needed_radius: float

    @property
    def rates(self) -> tuple[float, ...]:
        """Hinge rates [rad/s]: of the frame about the shell's axis, then of the rotors."""
        return tuple(cast(float, hinge.command) for hinge in self.ball.hinges)

    @property
    def reach(self) -> float:
        """√(tr Σ/m) of the frame [m], the smallest radius within which the frame's mass fits."""
        frame = self.ball.frame
        return math.sqrt(float(np.trace(frame.inertia)) / 2 / frame.mass)

    @property
    def buildable(self) -> bool:
        """Whether the frame fits within `allowed_radius`."""
        return self.reach <= self.allowed_radius * (1 + ROUNDING)

    @property
    def allowed_radius(self) -> float:
        """Largest allowed radius of the frame [m], by default the shell's inner radius."""
        return self.limits.radii(self.ball.radius)[0]

    @property
    def verdict(self) -> str:
        """One line that says whether the ball can be built, and which radius the frame needs."""
        if self.buildable:
            return (
                "can be built: all mass fits inside the shell, the frame's within "
                f"{self.reach:.4g} m of {self.allowed_radius:.4g} m allowed"
            )
        inside = self.needed_radius <= self.ball.radius - self.limits.shell_thickness
        boundary = "the frame's radius" if inside else "the shell"
        return (
            f"can be simulated, but not built: mass would lie outside {boundary}: the frame needs "
            f"a radius of {self.needed_radius:.4g} m (here {self.reach:.4g} m), but only "
            f"{self.allowed_radius:.4g} m is allowed"
        )


def design(
    A: ArrayLike,
    Omega: ArrayLike,
    K: ArrayLike,
    radius: float,
    mass: float | None = None,
    limits: Limits | None = None,
) -> Design:
    """Design a ball with the requested A, Ω and K and as few rotors as possible.

    The shell's axis is along Omega, or along z if Omega is zero. The rotors are rings with
    Σ j φ̇ n = K + (J_s + d)Ω, which follows from (A.3) and K = k - dΩ. No rotor is needed if this
    sum can be zero. One rotor is enough if rates are unlimited, and two are always enough. The
    masses satisfy all bounds with the largest margin. A frame that fits, or nearly fits, has
    priority over a smaller number of rotors.

    Parameters
    ----------
    A : (3,) or (3, 3), 1/(kg m²), frame axes
        The inverse of the inertia about the contact point, or its diagonal.
    Omega : (3,), rad/s, frame axes
        The rate of the frame relative to the shell.
    K : (3,), kg m²/s, frame axes
        The momentum of the rotating parts.
    radius : float, m
        The radius of the shell.
    mass : float, kg, optional
        The mass of the ball. By default the mass with the largest margin.
    limits : Limits, optional
        Bounds on the bodies. By default only the size of the shell.

    Returns
    -------
    Design
        The ball, with the rates of its hinges.

    Raises
    ------
    InputError
        If no such ball exists. The message names the violated condition, its value, its limit and
        the difference.

    Examples
    --------
    >>> import robotball as rb
    >>> result = rb.design(A=[0.7, 0.6, 0.8], Omega=[0, 0, 2], K=[2, 2, 0], radius=1.0)
    >>> print(f"{len(result.ball.rotors)} rotor at {result.rates[1]:.1f} rad/s")
    1 rotor at 138.9 rad/s
    """
    limits = Limits() if limits is None else limits
    _check_sizes(radius, mass, limits)
    # np.linalg.inv is symmetric only up to rounding, but eigvalsh reads only half of the matrix.
    B = np.linalg.inv(_symmetric_positive(A))
    B = (B + B.T) / 2
    Omega, K = _vector("Omega", Omega), _vector("K", K)
    _check_inertia_at(B, radius, mass, limits)
    request = _request(B, Omega, K, radius, mass, limits)
    _check_least_masses(request)
    needed = request.frame_radius
    # Unless the limits forbid it, a ball whose frame does not fit is designed nevertheless, because
    # it can be simulated. Its frame exceeds the least possible radius by at most 10 %, or by more
    # if no number of rotors permits this.
    shares = share(request, needed)
    if (
        shares is None
        and not limits.buildable
        and _largest_margin(request, math.inf) > _LEAST_MARGIN
    ):
        needed = _least_frame_radius(request)
        shares = share(request, WIDER * needed) or share(request, math.inf)
    if shares is None:
        raise _refusal(request, limits, radius)
    ball, masses = _ball(shares, B, Omega, K, radius, limits), masses_allowed(B, radius)
    return Design(ball=ball, limits=limits, masses=masses, needed_radius=radius * needed)


def describe(design: Design) -> str:
    """Return a few lines of text: each body with its mass, size and rate, and the verdict."""
    ball, (least, most) = design.ball, design.masses
    shell, frame = ball.shell, ball.frame
    thickness = design.limits.shell_thickness
    kind = f"{thickness:g} m thick" if thickness else "thin"
    moments = ", ".join(f"{moment:.6g}" for moment in np.linalg.eigvalsh(frame.inertia))
    rows = [
        f"ball    radius {ball.radius:g} m, mass {ball.mass:.6g} kg "
        f"(at least {least:.6g} kg to fit inside the shell, at most {most:.6g} kg for a physical "
        "inertia)",
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
    """Design bodies for the A, Ω, K and radius of a scene. Also return the scene with these bodies.

    mass [kg]: of the ball. The default is the best mass in the rubber model. In the classical model
    (3.3) depends on d = m a², so the default is the mass of the scene's ball. numbers: replace the
    scene's Ω and K. The new scene has no motors. Raises InputError if the rates are not constant or
    no ball exists.
    """
    if mass is None and scene.rolling == "classical":  # another mass would change the motion
        mass = scene.ball.mass
    numbers, axes, ball = numbers or scene.parameters, scene.principal_axes, scene.ball
    result = design(ball.A, axes @ numbers.Omega, axes @ numbers.K, ball.radius, mass, limits)
    return result, replace(
        scene,
        name=f"{scene.name}_designed",
        title=f"{scene.title}, designed bodies",
        source=f"Bodies designed for the numbers of {scene.name}. {result.verdict}\n{scene.source}",
        ball=result.ball,
    )


def _check_sizes(radius: float, mass: float | None, limits: Limits) -> None:
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
        raise InputError(f"A must be 3 or 3 x 3 finite numbers; it is {np.asarray(A).tolist()}")
    if np.abs(matrix - matrix.T).max() > ROUNDING * np.abs(matrix).max():
        raise InputError(f"A must be symmetric; it is {matrix.tolist()}")
    least = float(np.linalg.eigvalsh(matrix)[0])
    if not least > 0:
        raise InputError(f"the least eigenvalue of A must be positive, not {least:.6g} 1/(kg m²)")
    # The values must also be moderate, so that products of a few values do not overflow.
    for value in (least, float(np.abs(matrix).max())):
        check_positive("A", value, "1/(kg m²)")
    return matrix


def _vector(name: str, v: ArrayLike) -> Array:
    vector = as_floats(name, v, (3,))
    for value in vector.tolist():
        check_size(name, value)
    return vector


def masses_allowed(B: Array, radius: float) -> tuple[float, float]:
    """Return Σb/5a² and (Σb - 2 max b)/a² [kg] for B = A⁻¹ (3, 3) [kg m²] and radius a [m].

    A ball needs at least the first mass to fit inside its shell, and at most the second mass to
    have a physical inertia. If the first mass exceeds the second, no ball can be built.
    """
    b = np.linalg.eigvalsh(B)
    return float(b.sum()) / 5 / radius**2, float(b.sum() - 2 * b[-1]) / radius**2


def _check_inertia_at(B: Array, radius: float, mass: float | None, limits: Limits) -> None:
    """Raise InputError if no body of this mass has B = A⁻¹ (3, 3) [kg m²]."""
    b = np.linalg.eigvalsh(B)
    least, most = masses_allowed(B, radius)
    if not most * radius**2 > _LEAST_MARGIN * b.sum():
        raise InputError(
            f"triangle inequality: the largest eigenvalue of 1/A, {b[2]:.6g} kg m², must be less "
            f"than the sum of the two others, {b[0] + b[1]:.6g} kg m²; for any mass it is "
            f"{b[2] - b[0] - b[1]:.6g} kg m² too large"
        )
    if mass is not None and not mass < most:
        moment, excess = b[0] - mass * radius**2, mass - most
        fault = (
            f"triangle inequality: 1/A - m a² violates it by {excess * radius**2:.6g} kg m²"
            if moment > 0
            else f"inertia not positive: 1/A - m a² has the principal moment {moment:.6g} kg m²"
        )
        raise InputError(
            f"{fault} at m = {mass:.6g} kg; m must be below {most:.6g} kg: {excess:.6g} kg too much"
        )
    heaviest = most if mass is None else mass
    if limits.buildable and not heaviest > least:
        at_most = "at most " if mass is None else ""
        raise InputError(
            f"mass inside the shell: m must be at least tr(1/A)/(5 a²) = {least:.6g} kg, but m is "
            f"{at_most}{heaviest:.6g} kg: {least - heaviest:.6g} kg too little"
        )


@dataclass(frozen=True)
class _DesignRequest:
    """Requested numbers and limits, in the units of this file.

    unit: the unit of mass [kg]; B (3, 3): A⁻¹; d: None if the mass is not given; shell_factor:
    J_s/(m_s a²); speed: largest rate of a rotor; shell, frame, rotor: least masses.
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
        """The s at which P ceases to be positive: tr(A⁻¹) - 2 max b."""
        return float(1 - 2 * np.linalg.eigvalsh(self.B)[-1])

    @property
    def smallest_s(self) -> float:
        """Least d + J_s: for the lightest shell, with d = the shell's mass if no mass is given."""
        J_s = self.shell_factor * self.shell
        return J_s + (self.shell if self.d is None else self.d)

    def momentum(self, s: Array) -> Array:
        """Return the rotors' momentum h = K + sΩ (..., 3) for s (...)."""
        return self.K + s[..., None] * self.Omega

    @property
    def s_without_rotors(self) -> tuple[float, float] | None:
        """The interval of s in which h = 0, or None if there is none."""
        if not np.any(self.Omega):
            return None if np.any(self.K) else (self.smallest_s, self.largest_s)
        s = float(-self.K @ self.Omega / (self.Omega @ self.Omega))
        size = float(np.linalg.norm(self.K)) + s * float(np.linalg.norm(self.Omega))
        still = np.linalg.norm(self.momentum(np.array(s))) <= _NO_MOMENTUM * size
        return (s, s) if still and self.smallest_s <= s <= self.largest_s else None


def _request(
    B: Array, Omega: Array, K: Array, radius: float, mass: float | None, limits: Limits
) -> _DesignRequest:
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
    unit = request.unit
    rotors = 0.0 if request.s_without_rotors else request.rotor
    least = request.shell + request.frame + rotors
    if request.d is not None and not least < request.d:
        raise InputError(
            "masses: the minimum masses of shell, frame and rotor add up to "
            f"{least * unit:.6g} kg, {(least - request.d) * unit:.6g} kg more than the ball's mass "
            f"of {request.d * unit:.6g} kg"
        )
    J_s = request.shell_factor * request.shell
    s = J_s + (least if request.d is None else request.d)
    if not s < request.largest_s:
        raise InputError(
            "masses: the minimum masses of shell, frame and rotor add up to "
            f"{least * unit:.6g} kg, so m + J_s/a² is at least {s * unit:.6g} kg; the frame's "
            f"triangle inequality allows less than {request.largest_s * unit:.6g} kg: "
            f"{(s - request.largest_s) * unit:.6g} kg too much"
        )


@dataclass(frozen=True)
class _Shares:
    """Masses of the bodies, and axial inertias (n,) and axes (n, 3) of the rings.

    margin: the margin of the tightest bound, relative to tr(A⁻¹).
    """

    margin: float
    shell_mass: float
    frame_mass: float
    rotor_masses: Array
    axial_inertias: Array
    axes: Array


def share(request: _DesignRequest, frame_radius: float) -> _Shares | None:
    """Return the shares with the fewest rotors and the frame within `frame_radius`, or None.

    Among all such shares, return those with the largest margin.
    """
    for n in _rotor_counts(request):
        s, T, margin = _best(request, n, frame_radius)
        if margin > _LEAST_MARGIN:
            return _bodies(request, n, s, T, margin)
    return None


def _rotor_counts(request: _DesignRequest) -> range:
    # In order of preference. With unlimited rates a rotor can be arbitrarily light, so a second
    # rotor does not help.
    return range(2 if np.isinf(request.speed) else 1 + _MOST_ROTORS)


def _best(request: _DesignRequest, n: int, frame_radius: float) -> tuple[float, float, float]:
    """Return s, T and the margin of the best shares with n rotors."""
    ends = (request.smallest_s, request.largest_s) if n else request.s_without_rotors
    if ends is None or ends[0] > ends[1]:
        return 0.0, 0.0, -np.inf

    def best_T(s: Array) -> Array:
        g = np.linalg.norm(request.momentum(s), axis=-1) / request.speed
        if n < 2:
            return n * g
        most = np.maximum((1 - 3 * s) / 2, g)  # at the first, tr(2 Σ_frame) = tr P - 2T is 0
        return _peak(lambda T: _margin(request, n, frame_radius, s[..., None], T), g, most, 9, 7)

    def margin(s: Array) -> Array:
        return _margin(request, n, frame_radius, s, best_T(s))

    s = _peak(margin, np.array(ends[0]), np.array(ends[1]), 25, 6)
    return float(s), float(best_T(s)), float(margin(s))


def _peak(f: Callable[[Array], Array], low: Array, high: Array, points: int, rounds: int) -> Array:
    """Return the maximum (...) of a concave f, vectorised over (..., points), in [low, high]."""
    # Each round narrows the interval to 2/(points - 1) of its length: 25 points in 6 rounds reach
    # 3e-7, 9 points in 7 rounds 6e-5. Grids replace a scalar search, because T is searched for all
    # s of a round at once.
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
    """Return the margin (...) at s and T (...), positive iff all bounds are satisfied.

    The margin is the largest t with 2 Σ_frame >= t E, m_frame >= least + t, m_frame r² -
    tr Σ_frame >= t, m_shell >= least + t, and a single rotor's inertia larger than necessary by
    t ROTOR_SHARE. Each element of `bounds` is one of these bounds, linear in t, solved for t.
    """
    c, slower = request.shell_factor, ROTOR_SHARE if n == 1 else 0.0
    Z, tau = _Z(request, *np.broadcast_arrays(s, T))
    z = np.linalg.eigvalsh(Z)
    # Two rings add τ in the direction in which Z is smallest. Then another direction may be the
    # smallest.
    flattest = z[..., 0] if n < 2 else np.minimum(z[..., 0] + tau, z[..., 1])
    bounds = [flattest / (1 + slower)]
    if request.d is None:
        # The mass of the shell is the least mass plus t.
        others, others_per_t = s - (1 + c) * request.shell, 1 + c
    else:
        shell = (s - request.d) / c
        others, others_per_t = request.d - shell, 0.0
        bounds.append(shell - request.shell)
    trace = (1 - 3 * s) / 2 - T  # of Σ_frame: tr P = 1 - 3s, and a ring takes 2j of tr 2Σ
    # If the left side of a bound decreases by k t, the bound is satisfied if its value at t = 0 is
    # at least (1 + k) t; hence the divisors. The rotors' mass follows from their inertia or from
    # their least masses; for two rotors, `by_inertia` is too large by at most one least mass.
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
    # Without rotors T = 0 and h is zero up to rounding.
    per_T = np.divide(1.0, T, out=np.zeros_like(T), where=T > 0)
    returned = per_T[..., None, None] * g[..., :, None] * g[..., None, :]
    P_less_T = (1 - s - T)[..., None, None] * np.eye(3) - 2 * request.B
    return P_less_T + returned, T - per_T * (g * g).sum(axis=-1)


def _bodies(request: _DesignRequest, n: int, s: float, T: float, margin: float) -> _Shares:
    if request.d is None:
        shell = request.shell + margin
        d = s - request.shell_factor * shell
    else:
        d = request.d
        shell = (s - d) / request.shell_factor
    inertias, axes = _rings(request, n, s, T, margin)
    masses = np.maximum(inertias / request.rotor_radius**2, request.rotor)
    return _Shares(margin, shell, float(d - shell - masses.sum()), masses, inertias, axes)


def _rings(
    request: _DesignRequest, n: int, s: float, T: float, margin: float
) -> tuple[Array, Array]:
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

    g (3,), unit vector e (3,), τ = T - |g|²/T > 0. The rows (√T, g/√T) and (0, √τ e) have the right
    moments of (1, n), which any rotation of the two rows preserves; this one gives rows
    (√j, √j n) with unit vectors n.
    """
    # e and -e give the same moments; with g·e >= 0 the sum below does not cancel.
    e = np.copysign(1.0, g @ e) * e
    tangent = g @ e / np.sqrt(T * tau)
    x = 1 / (tangent + np.hypot(tangent, 1.0))  # tan of the angle; hypot - tangent would cancel
    across = x * np.sqrt(T * tau) * e
    return np.array([g + across, x * x * g - across]) / (1 + x * x)


def _refusal(request: _DesignRequest, limits: Limits, radius: float) -> InputError:
    """Return the reason why no shares exist although inertia and least masses would permit some."""
    # Drop each condition in turn. If shares exist without a condition, it is the reason.
    within = request.frame_radius if limits.buildable else math.inf
    any_speed = replace(request, speed=math.inf)
    if _largest_margin(any_speed, within) > _LEAST_MARGIN:
        needed = _least(lambda w: _largest_margin(replace(request, speed=w), within), request.speed)
        return InputError(
            f"rotor speed: the momentum K + (J_s + d)Ω needs {needed:.4g} rad/s, which exceeds the "
            f"limit of {request.speed:.6g} rad/s by {needed - request.speed:.4g} rad/s"
        )
    if limits.buildable and _largest_margin(any_speed, math.inf) > _LEAST_MARGIN:
        needed = radius * _least_frame_radius(any_speed)
        allowed = radius * request.frame_radius
        return InputError(
            f"mass inside the shell: the frame needs a radius of {needed:.4g} m, which exceeds the "
            f"limit of {allowed:.6g} m by {needed - allowed:.4g} m"
        )
    margin, least = request.unit * _largest_margin(any_speed, within), request.unit * _LEAST_MARGIN
    return InputError(
        f"masses: only {margin:.3g} kg are left after the minimum masses; rounding needs "
        f"{least:.3g} kg"
    )


def _largest_margin(request: _DesignRequest, frame_radius: float) -> float:
    return max(_best(request, n, frame_radius)[2] for n in _rotor_counts(request))


def _least_frame_radius(request: _DesignRequest) -> float:
    return _least(lambda radius: _largest_margin(request, radius), request.frame_radius)


def _least(largest_margin: Callable[[float], float], too_small: float) -> float:
    """Return the least value of a bound for which shares exist, to four digits.

    Shares must exist for a large bound, and must not exist for the bound `too_small`.
    """

    # Search for 1/bound, for which the search interval is finite.
    def margin(per_bound: float) -> float:
        return largest_margin(1 / per_bound if per_bound else math.inf) - _LEAST_MARGIN

    return float(1 / brentq(margin, 0.0, 1 / too_small, rtol=1e-4, xtol=1e-4 / too_small))


def _ball(shares: _Shares, B: Array, Omega: Array, K: Array, radius: float, limits: Limits) -> Ball:
    trace = float(np.trace(B))
    unit = trace / radius**2  # kg
    shell_mass, frame_mass = unit * shares.shell_mass, unit * shares.frame_mass
    J_s = shell_inertia(radius, shell_mass, limits.shell_thickness)
    turning = float(np.linalg.norm(Omega))
    axis = Omega / turning if turning else np.array([0.0, 0.0, 1.0])
    shell = Shell(radius, shell_mass, J_s, J_s, axis)
    rotors = tuple(
        Rotor(float(unit * m), float(trace * j), float(trace * j) / 2, n)
        for m, j, n in zip(shares.rotor_masses, shares.axial_inertias, shares.axes, strict=True)
    )
    # The frame gets the rounding errors, so that the whole ball has exactly the requested numbers.
    d = (shell_mass + frame_mass + sum(rotor.mass for rotor in rotors)) * radius**2
    others = shell.inertia + sum((rotor.inertia for rotor in rotors), np.zeros((3, 3)))
    frame = Frame(frame_mass, B - d * np.eye(3) - others)
    rates = [limits.rotor_speed] * len(rotors)  # if there are two, both turn at the largest rate
    if len(rotors) == 1:
        h = K + (J_s + d) * Omega
        rates = [float(np.linalg.norm(h)) / rotors[0].axial_inertia]
    return Ball(shell, (Hinge(frame, turning), *map(Hinge, rotors, rates)))


def _in_digits(v: Array) -> str:
    return f"({v[0]:.6g}, {v[1]:.6g}, {v[2]:.6g})"
