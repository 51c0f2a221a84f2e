"""Design a ball with the requested A, Ω, K and radius, or report why none exists.

The inertia is divided between a shell, a frame and at most one rotor.

A body enters the equations only through the second moments of its mass, Σ = ∫ r rᵀ dm =
½ tr(I) E - I. A body with Σ exists iff Σ is positive (for I: the triangle inequality), and its mass
m fits within the radius r iff tr Σ <= m r². With s = d + J_s, a shell of equal moments and a flat
ring as the rotor (axial inertia j, axis n, rate φ̇) leave to the frame

    2 Σ_frame = P - j (E - n nᵀ),    P = tr(A⁻¹) E - 2 A⁻¹ - s E,

and the rotor must provide h = K + sΩ = j φ̇ n. So j is |h| over the largest rate. All bounds are
almost concave in s, which is found by an ascent. A second rotor would lower the necessary rate only
if the rings may be large: for Fig. 12, from 19 to 12 rad/s with 0.9 m, but not at all with 0.6 m.

Units in this file: tr(A⁻¹) = 1 [kg m²], shell radius = 1 m.

When no ball exists: let b be the eigenvalues of A⁻¹ and d = m a². The inertia A⁻¹ - d E belongs to
a body iff d <= Σb - 2 max b (triangle inequality), and its mass fits inside the shell iff
d >= Σb/5. Both are possible iff max b <= (2/5) Σb.
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

# Margin, relative to tr(A⁻¹), below which a design is refused because rounding would decide.
_LEAST_MARGIN = 1e-9
_ROTOR_SHARE = 0.5  # fraction of the margin that makes the rotor larger and slower
_NO_MOMENTUM = 1e-14  # relative to K: a smaller K + sΩ is zero
_ROTOR_RADIUS = 0.6  # default, in frame radii
# Radius allowed to a frame that does not fit, over the least possible one, which would leave the
# other bounds no margin.
_WIDER = 1.1
# Grid of a search: each round narrows the interval to 1/12, so 6 rounds reach 3e-7 of it.
_GRID, _ROUNDS = np.linspace(0.0, 1.0, 25), 6


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bound the bodies of a design. By default only the size of the shell does.

    Attributes
    ----------
    rotor_speed : float, rad/s
        The largest rate of the rotor.
    frame_radius : float or None, m
        The radius within which the frame must fit. By default the inner radius of the shell.
    rotor_radius : float or None, m
        The largest radius of the rotor. By default 0.6 of the frame's.
    shell_mass : float, kg
        The least mass of the shell.
    frame_mass : float, kg
        The least mass of the frame.
    rotor_mass : float, kg
        The least mass of the rotor.
    shell_thickness : float, m
        The thickness of a homogeneous shell. 0 is a thin shell.
    buildable : bool
        Whether a ball with mass outside `frame_radius` is refused.

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
        """Return the largest radii of frame and rotor in a shell of `radius` [m]."""
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
        The ball's least mass for which all mass fits inside the shell, and its largest mass for
        which the inertia is physical.
    needed_radius : float, m
        The least radius within which the frame fits, if it exceeds the allowed radius; otherwise
        the allowed radius.

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
        """√(tr Σ/m) of the frame [m], the smallest radius within which its mass fits."""
        frame = self.ball.frame
        return math.sqrt(float(np.trace(frame.inertia)) / 2 / frame.mass)

    @property
    def buildable(self) -> bool:
        """Whether the frame fits within its allowed radius."""
        return self.reach <= self.allowed_radius * (1 + ROUNDING)

    @property
    def allowed_radius(self) -> float:
        """Limit of the frame's radius, by default the shell's inner radius [m]."""
        return self.limits.radii(self.ball.radius)[0]

    @property
    def verdict(self) -> str:
        """One line: whether the ball can be built, and if not, which radius its frame needs."""
        if self.buildable:
            within = f"{self.reach:.4g} m of {self.allowed_radius:.4g} m allowed"
            return f"can be built: all mass fits inside the shell, the frame's within {within}"
        inside = self.needed_radius <= self.ball.radius - self.limits.shell_thickness
        boundary = "the frame's radius" if inside else "the shell"
        needed = f"{self.needed_radius:.4g} m (here {self.reach:.4g} m)"
        line = f"the frame needs a radius of {needed}, {self.allowed_radius:.4g} m is allowed"
        return f"can be simulated, but not built: mass would lie outside {boundary}: {line}"


def design(
    A: ArrayLike,
    Omega: ArrayLike,
    K: ArrayLike,
    radius: float,
    mass: float | None = None,
    limits: Limits | None = None,
) -> Design:
    """Design a ball with the requested A, Ω and K and at most one rotor.

    The shell's axis is along Omega, or z if Omega is zero. The rotor is a ring with j φ̇ n = K +
    (J_s + d)Ω, by (A.3) and K = k - dΩ. No rotor is needed if that can be zero. The masses satisfy
    all bounds with the largest margin. A frame that fits, or nearly so, has priority over a ball
    without a rotor.

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
        The bodies and their rates.

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
    # np.linalg.inv is symmetric only up to rounding, and eigvalsh reads one half of the matrix.
    B = np.linalg.inv(_symmetric_positive(A))
    B = (B + B.T) / 2
    Omega, K = _vector("Omega", Omega), _vector("K", K)
    _check_inertia_at(B, radius, mass, limits)
    request = _request(B, Omega, K, radius, mass, limits)
    _check_least_masses(request)
    needed = request.frame_radius
    # Unless the limits forbid it, a frame that does not fit is still simulated. It exceeds the
    # least possible radius by 10 %, or by what a ball without a rotor needs.
    shares, outside = _share(request, needed), _largest_margin(request, math.inf)
    if shares is None and not limits.buildable and outside > _LEAST_MARGIN:
        needed = _least_frame_radius(request)
        shares = _share(request, _WIDER * needed) or _share(request, math.inf)
    if shares is None:
        raise _refusal(request, limits, radius)
    return Design(
        ball=_ball(shares, B, Omega, K, radius, limits),
        limits=limits,
        masses=_masses_allowed(B, radius),
        needed_radius=radius * needed,
    )


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
    for rotor, rate in zip(ball.rotors, design.rates[1:], strict=True):
        ring = math.sqrt(rotor.axial_inertia / rotor.mass)
        axis = f"axis {_in_digits(rotor.axis)}, {rate:.6g} rad/s"
        rows.append(f"rotor1  mass {rotor.mass:.6g} kg, ring of radius {ring:.4g} m, {axis}")
    return "\n".join([*rows, design.verdict])


def redesign(
    scene: Scene, mass: float | None, limits: Limits, numbers: Parameters | None = None
) -> tuple[Design, Scene]:
    """Design bodies for the A, Ω, K and radius of a scene. Return also the scene with them.

    mass [kg]: of the ball. By default the best one in the rubber model, and the scene's in the
    classical model, where (3.3) depends on d = m a², too. numbers: replace the scene's Ω and K. The
    new scene has no motors. Raises InputError if the rates are not constant or no ball exists.
    """
    if mass is None and scene.rolling == "classical":  # another mass would change the motion
        mass = scene.ball.mass
    numbers, axes = numbers or scene.parameters, scene.principal_axes
    result = design(
        scene.ball.A, axes @ numbers.Omega, axes @ numbers.K, scene.ball.radius, mass, limits
    )
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
        line = f"at least 0 and less than the radius {radius:g} m, not {limits.shell_thickness:g} m"
        raise InputError(f"shell_thickness must be {line}")
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
        raise InputError(f"A must be symmetric, not {matrix.tolist()}")
    least = float(np.linalg.eigvalsh(matrix)[0])
    if not least > 0:
        raise InputError(f"A must be positive: its least eigenvalue is {least:.6g} 1/(kg m²)")
    # The values must also be moderate, so that products of a few do not overflow.
    for value in (least, float(np.abs(matrix).max())):
        check_positive("A", value, "1/(kg m²)")
    return matrix


def _vector(name: str, v: ArrayLike) -> Array:
    vector = as_floats(name, v, (3,))
    for value in vector.tolist():
        check_size(name, value)
    return vector


def _masses_allowed(B: Array, radius: float) -> tuple[float, float]:
    """Return Σb/5a² and (Σb - 2 max b)/a² [kg] for B = A⁻¹ (3, 3) [kg m²] and radius a [m].

    A ball needs at least the first mass to fit inside its shell, and at most the second to have a
    physical inertia. If the first exceeds the second, the ball cannot be built.
    """
    b = np.linalg.eigvalsh(B)
    return float(b.sum()) / 5 / radius**2, float(b.sum() - 2 * b[-1]) / radius**2


def _check_inertia_at(B: Array, radius: float, mass: float | None, limits: Limits) -> None:
    """Raise InputError if no body of this mass has B = A⁻¹ (3, 3) [kg m²]."""
    b = np.linalg.eigvalsh(B)
    least, most = _masses_allowed(B, radius)
    if not most * radius**2 > _LEAST_MARGIN * b.sum():
        moments = f"{b[2]:.6g} kg m², exceeds the sum of the others, {b[0] + b[1]:.6g} kg m²"
        moments += f", by {b[2] - b[0] - b[1]:.6g} kg m², whatever the mass"
        raise InputError(f"triangle inequality: the largest eigenvalue of 1/A, {moments}")
    if mass is not None and not mass < most:
        moment, excess = b[0] - mass * radius**2, mass - most
        fault = (
            f"triangle inequality: 1/A - m a² breaks it by {excess * radius**2:.6g} kg m²"
            if moment > 0
            else f"inertia not positive: 1/A - m a² has the principal moment {moment:.6g} kg m²"
        )
        raise InputError(
            f"{fault} at m = {mass:.6g} kg; m must be less than {most:.6g} kg, {excess:.6g} kg less"
        )
    heaviest = most if mass is None else mass
    if limits.buildable and not heaviest > least:
        at_most = "at most " if mass is None else ""
        mass_is = f"is {at_most}{heaviest:.6g} kg: {least - heaviest:.6g} kg too little"
        line = f"m must be at least tr(1/A)/(5 a²) = {least:.6g} kg, but {mass_is}"
        raise InputError(f"mass inside the shell: {line}")


@dataclass(frozen=True)
class _DesignRequest:
    """Requested numbers and limits, in the units of this file.

    unit: the unit of mass [kg]; B (3, 3): A⁻¹; d: None if the mass is free; shell_factor:
    J_s/(m_s a²); speed: largest rotor rate; shell, frame, rotor: least masses.
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
        """Least d + J_s: with the lightest shell, and d = its mass if the mass is free."""
        J_s = self.shell_factor * self.shell
        return J_s + (self.shell if self.d is None else self.d)

    def momentum(self, s: Array) -> Array:
        """Return the rotor's momentum h = K + sΩ (..., 3) for s (...)."""
        return self.K + s[..., None] * self.Omega

    def rotor_inertia(self, s: Array) -> Array:
        """Return the rotor's axial inertia (...) at the largest rate."""
        return np.linalg.norm(self.momentum(s), axis=-1) / self.speed

    @property
    def s_without_rotors(self) -> tuple[float, float] | None:
        """The interval of s in which h = 0, or None."""
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
        mass = f"{least * unit:.6g} kg, of {request.d * unit:.6g} kg for the ball"
        excess = f"{(least - request.d) * unit:.6g} kg too much"
        raise InputError(f"masses: shell, frame and rotor have at least {mass}: {excess}")
    J_s = request.shell_factor * request.shell
    s = J_s + (least if request.d is None else request.d)
    if not s < request.largest_s:
        mass = f"shell, frame and rotor have at least {least * unit:.6g} kg"
        sum_ = f"m + J_s/a² is {s * unit:.6g} kg, of at most {request.largest_s * unit:.6g} kg"
        excess = f"{(s - request.largest_s) * unit:.6g} kg too much"
        raise InputError(f"masses: {mass}; {sum_} by the frame's triangle inequality: {excess}")


@dataclass(frozen=True)
class _Shares:
    """Masses of the bodies, and the rotor's axial inertia and axis (3,); None without a rotor.

    margin: of the tightest bound, relative to tr(A⁻¹).
    """

    margin: float
    shell_mass: float
    frame_mass: float
    rotor_mass: float = 0.0
    axial_inertia: float = 0.0
    axis: Array | None = None


def _share(request: _DesignRequest, frame_radius: float) -> _Shares | None:
    """Return the shares of the largest margin with the frame within `frame_radius`, or None.

    A rotor is used only if it is needed.
    """
    for n in (0, 1):
        s, margin = _best(request, n, frame_radius)
        if margin > _LEAST_MARGIN:
            return _bodies(request, n, s, margin)
    return None


def _best(request: _DesignRequest, n: int, frame_radius: float) -> tuple[Array, float]:
    """Return s (a scalar) and the margin of the best shares with n rotors, 0 or 1."""
    ends = (request.smallest_s, request.largest_s) if n else request.s_without_rotors
    if ends is None or ends[0] > ends[1]:
        return np.zeros(()), -np.inf
    low, high = ends
    for _ in range(_ROUNDS):
        s = low + (high - low) * _GRID
        best = int(_margin(request, n, frame_radius, s).argmax())
        low, peak, high = s[np.clip([best - 1, best, best + 1], 0, len(s) - 1)]
    return peak, float(_margin(request, n, frame_radius, peak))


def _margin(request: _DesignRequest, n: int, frame_radius: float, s: Array) -> Array:
    """Return the margin (...) at s (...), positive iff all bounds are satisfied.

    It is the largest t with 2 Σ_frame >= t E, m_frame >= least + t, m_frame r² - tr Σ_frame >= t,
    m_shell >= least + t, and a rotor's inertia larger than necessary by t _ROTOR_SHARE. Each
    element of `bounds` is one of these, linear in t, solved for t.
    """
    c, slower, j = request.shell_factor, n * _ROTOR_SHARE, n * request.rotor_inertia(s)
    # Without a rotor j = 0 and h is zero up to rounding.
    g = request.momentum(s) / request.speed
    per_j = np.divide(1.0, j, out=np.zeros_like(j), where=j > 0)
    returned = per_j[..., None, None] * g[..., :, None] * g[..., None, :]
    P_less_j = (1 - s - j)[..., None, None] * np.eye(3) - 2 * request.B
    bounds = [np.linalg.eigvalsh(P_less_j + returned)[..., 0] / (1 + slower)]
    if request.d is None:
        # The shell has its least mass plus t.
        others, others_per_t = s - (1 + c) * request.shell, 1 + c
    else:
        shell = (s - request.d) / c
        others, others_per_t = request.d - shell, 0.0
        bounds.append(shell - request.shell)
    trace = (1 - 3 * s) / 2 - j  # of Σ_frame: tr P = 1 - 3s, and a ring takes 2j of tr 2Σ
    # A bound whose left side decreases by k t is satisfied if its value at t = 0 is at least
    # (1 + k) t: hence the divisors. The rotor's mass follows from its inertia or its least mass.
    by_inertia = j / request.rotor_radius**2, slower / request.rotor_radius**2
    for rotor, per_t in (by_inertia, (n * request.rotor, 0.0)):
        frame, frame_per_t = others - rotor, others_per_t + per_t
        bounds.append((frame - request.frame) / (1 + frame_per_t))
        if np.isfinite(frame_radius):
            room = frame_radius**2 * frame - trace
            bounds.append(room / (1 + frame_radius**2 * frame_per_t - slower))
    return np.min(np.broadcast_arrays(*bounds), axis=0)


def _bodies(request: _DesignRequest, n: int, s: Array, margin: float) -> _Shares:
    shell = request.shell + margin if request.d is None else 0.0
    d = float(s) - request.shell_factor * shell if request.d is None else request.d
    if request.d is not None:
        shell = (float(s) - d) / request.shell_factor
    if not n:
        return _Shares(margin, shell, d - shell)
    j, h = float(request.rotor_inertia(s)) + _ROTOR_SHARE * margin, request.momentum(s)
    rotor = max(j / request.rotor_radius**2, request.rotor)
    return _Shares(margin, shell, d - shell - rotor, rotor, j, h / np.linalg.norm(h))


def _refusal(request: _DesignRequest, limits: Limits, radius: float) -> InputError:
    """Return the reason why no shares exist although inertia and least masses would allow some."""
    # Lift each condition in turn: the one without which shares exist is the reason.
    within = request.frame_radius if limits.buildable else math.inf
    any_speed = replace(request, speed=math.inf)
    if _largest_margin(any_speed, within) > _LEAST_MARGIN:
        needed = _least(
            lambda speed: _largest_margin(replace(request, speed=speed), within), request.speed
        )
        limit = f"of at most {request.speed:.6g} rad/s: {needed - request.speed:.4g} rad/s more"
        line = f"the momentum K + (J_s + d)Ω needs {needed:.4g} rad/s, {limit}"
        return InputError(f"rotor speed: {line}")
    if limits.buildable and _largest_margin(any_speed, math.inf) > _LEAST_MARGIN:
        needed = radius * _least_frame_radius(any_speed)
        allowed = radius * request.frame_radius
        line = f"{needed:.4g} m, of at most {allowed:.6g} m: {needed - allowed:.4g} m more"
        return InputError(f"mass inside the shell: the frame needs a radius of {line}")
    margin, least = request.unit * _largest_margin(any_speed, within), request.unit * _LEAST_MARGIN
    line = f"{margin:.3g} kg, below the {least:.3g} kg needed because of rounding"
    return InputError(f"masses: inertia and least masses leave a margin of {line}")


def _largest_margin(request: _DesignRequest, frame_radius: float) -> float:
    return max(_best(request, n, frame_radius)[1] for n in (0, 1))


def _least_frame_radius(request: _DesignRequest) -> float:
    return _least(lambda radius: _largest_margin(request, radius), request.frame_radius)


def _least(largest_margin: Callable[[float], float], too_small: float) -> float:
    """Return the least value of a bound for which shares exist, to four digits.

    They must exist for a large bound, and not for `too_small`.
    """

    # In terms of 1/bound the search interval is finite.
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
    m, j = unit * shares.rotor_mass, trace * shares.axial_inertia
    rotors = [] if shares.axis is None else [Rotor(m, j, j / 2, shares.axis)]
    # The frame absorbs rounding, so that the whole ball has exactly the requested numbers.
    d = (shell_mass + frame_mass + m) * radius**2
    others = shell.inertia + sum((rotor.inertia for rotor in rotors), np.zeros((3, 3)))
    frame = Frame(frame_mass, B - d * np.eye(3) - others)
    h = float(np.linalg.norm(K + (J_s + d) * Omega))
    return Ball(shell, (Hinge(frame, turning), *(Hinge(rotor, h / j) for rotor in rotors)))


def _in_digits(v: Array) -> str:
    return f"({v[0]:.6g}, {v[1]:.6g}, {v[2]:.6g})"
