"""The ball's bodies and the few numbers of them that the equations know (Appendix A)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotball.errors import InputError, check_positive
from robotball.rotations import Array

# How far, relative to its largest part, an inertia may miss a condition by rounding alone.
ROUNDING = 1e-12


def axial_tensor(axial: float, transverse: float, axis: Array) -> Array:
    """The inertia tensor (3, 3) of a body with a symmetry axis (3,) [kg m²]."""
    return transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)


def thin_shell_inertia(radius: float, mass: float) -> float:
    """2/3 m a², the inertia of a spherical shell of no thickness about any diameter [kg m²]."""
    return 2 / 3 * mass * radius**2


@dataclass(frozen=True)
class Shell:
    """The sphere that rolls: symmetric about `axis` (3,), about which the frame turns in it.

    SI units; `axis` is a unit vector in frame axes.
    """

    radius: float
    mass: float
    axial_inertia: float
    transverse_inertia: float
    axis: Array

    @property
    def inertia(self) -> Array:
        return axial_tensor(self.axial_inertia, self.transverse_inertia, self.axis)


@dataclass(frozen=True)
class Frame:
    """What turns inside the shell and carries the rotors: mass [kg], inertia (3, 3) [kg m²]."""

    mass: float
    inertia: Array


@dataclass(frozen=True)
class Rotor:
    """A symmetric body turning on the frame about its own axis (3,), a unit vector."""

    mass: float
    axial_inertia: float
    transverse_inertia: float
    axis: Array

    @property
    def inertia(self) -> Array:
        return axial_tensor(self.axial_inertia, self.transverse_inertia, self.axis)


@dataclass(frozen=True)
class Ball:
    """Shell, frame and rotors with a common centre of mass at the centre of the sphere.

    Tensors and vectors are in the frame's own axes, which need not be principal axes.
    """

    shell: Shell
    frame: Frame
    rotors: tuple[Rotor, ...]

    def __post_init__(self) -> None:
        check_positive("the shell's radius", self.shell.radius, "m")
        for name, body in self.named_bodies:
            check_positive(f"{name}'s mass", body.mass, "kg")
            check_inertia(name, body.inertia)
        for name, body in self.named_bodies:
            if not isinstance(body, Frame):
                _check_unit(f"{name}'s axis", body.axis)

    @property
    def named_bodies(self) -> tuple[tuple[str, Shell | Frame | Rotor], ...]:
        """(name, body), the shell first; the names are those of the MuJoCo bodies."""
        rotors = [(f"rotor{i}", rotor) for i, rotor in enumerate(self.rotors, start=1)]
        return (("shell", self.shell), ("frame", self.frame), *rotors)

    @property
    def radius(self) -> float:
        return self.shell.radius

    @cached_property
    def mass(self) -> float:
        return float(sum(body.mass for _, body in self.named_bodies))

    @cached_property
    def d(self) -> float:
        """M a² [kg m²]: the ball's mass as seen from the contact point."""
        return self.mass * self.radius**2

    @cached_property
    def inertia(self) -> Array:
        """The whole ball's inertia (3, 3) about its centre, frame axes [kg m²]."""
        return np.array([body.inertia for _, body in self.named_bodies]).sum(axis=0)

    @cached_property
    def principal(self) -> tuple[Array, Array]:
        """Principal moments I (3,) and axes, the columns of a rotation (3, 3), frame axes.

        Axes that are principal already are kept as they are, in their own order.
        """
        moments = np.diag(self.inertia)
        if np.abs(self.inertia - np.diag(moments)).max() <= 1e-14 * moments.sum():
            return moments.copy(), np.eye(3)
        moments, axes = np.linalg.eigh(self.inertia)
        return moments, axes if np.linalg.det(axes) > 0 else -axes

    @cached_property
    def A(self) -> Array:
        """(I + d E)⁻¹ (3, 3) in frame axes [1/(kg m²)]."""
        return np.linalg.inv(self.inertia + self.d * np.eye(3)).astype(np.float64)

    def gyrostatic_momentum(self, frame_rate: float, rotor_rates: tuple[float, ...]) -> Array:
        """k (3,) of (A.3): Σ j φ̇ n - J_s Ω, in frame axes [kg m²/s].

        frame_rate: the frame's rate about the shell's axis [rad/s]; rotor_rates (n,) [rad/s].
        """
        k = -self.shell.axial_inertia * frame_rate * self.shell.axis
        for rotor, rate in zip(self.rotors, rotor_rates, strict=True):
            k = k + rotor.axial_inertia * rate * rotor.axis
        return k


def check_inertia(name: str, inertia: Array) -> None:
    """Raises InputError unless the tensor (3, 3) is one that a rigid body can have."""
    if not np.all(np.isfinite(inertia)):
        raise InputError(f"{name}'s inertia has an entry that is not finite: {inertia.tolist()}")
    if np.abs(inertia - inertia.T).max() > ROUNDING * np.abs(inertia).max():
        raise InputError(f"{name}'s inertia is not symmetric: {inertia.tolist()}")
    small, middle, large = np.linalg.eigvalsh(inertia)
    if small <= 0:
        raise InputError(
            f"{name}'s inertia is not positive: its smallest principal moment is {small:.6g} kg m²"
        )
    if large - small - middle > ROUNDING * large:
        raise InputError(
            f"{name}'s inertia breaks the triangle inequality: {large:.6g} > {small:.6g} + "
            f"{middle:.6g} by {large - small - middle:.6g} kg m²; no body of positive mass has it"
        )


def _check_unit(what: str, axis: Array) -> None:
    length = float(np.linalg.norm(axis))
    if not abs(length - 1) <= ROUNDING:
        raise InputError(f"{what} must be a unit vector; its length is {length:.17g}")
