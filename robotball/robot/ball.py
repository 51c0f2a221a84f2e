"""The bodies and hinges of a ball, and the parameters of the equations that follow from them."""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robotball.errors import LARGEST, InputError, check_positive, check_size, unknown
from robotball.rotations import Array, as_floats

if TYPE_CHECKING:
    from robotball.robot.drives import Rate
    from robotball.robot.motors import Motor

# The folder mjcf/ has hand-written MJCF of the floor and of the bodies. In a wheel it is inside the
# package, in a checkout beside the package.
_INSIDE, _BESIDE = (folder / "mjcf" for folder in Path(__file__).parents[1:3])
PARTS = _INSIDE if _INSIDE.is_dir() else _BESIDE
# Tolerance relative to the largest entry. A computed tensor has rounding errors of 1e-16; a wrong
# tensor violates a condition by far more.
ROUNDING = 1e-12
SYMMETRIC = 1e-9  # the same for a composed body, whose entries are sums over its parts
_LARGEST_MOMENT = LARGEST**3  # kg m², a mass times a length squared; the least is its inverse
_SHAPES = {"inertia": (3, 3), "asymmetry": (3, 3), "attitude": (4,)}  # other arrays are vectors


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view of an array."""
    view = array.view()
    view.flags.writeable = False
    return view


def cached_array(compute: Callable[[Any], Array]) -> "cached_property[Array]":
    """Make a cached property whose array is read-only."""

    @wraps(compute)
    def protected(self: Any) -> Array:
        return read_only(compute(self))

    return cached_property(protected)


class Value:
    """Base of dataclasses with arrays. The arrays are read-only.

    Two records of one type are equal if all their compared fields are equal. NaN equals NaN in
    arrays. Records cannot be hashed, because arrays cannot be hashed.
    """

    def __post_init__(self) -> None:
        self._set(**vars(self))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._set(**state)  # arrays of pickled and copied records are writable

    def _set(self, **values: Any) -> None:
        """Set fields while the record is being made; arrays become read-only."""
        for name, value in values.items():
            value = read_only(value) if isinstance(value, np.ndarray) else value
            object.__setattr__(self, name, value)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # Set on each class, because the __eq__ that a dataclass generates fails on arrays.
        cls.__eq__ = _equal  # type: ignore[method-assign]


def _equal(one: Any, other: Any) -> Any:
    if type(one) is not type(other):
        return NotImplemented
    names = [entry.name for entry in fields(one) if entry.compare]
    return all(_same(getattr(one, name), getattr(other, name)) for name in names)


def _same(one: Any, other: Any) -> bool:
    """Return whether two values are equal. Arrays, even within tuples, are compared by element."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        one, other = np.asarray(one), np.asarray(other)
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    try:
        return bool(one == other)
    except ValueError:  # comparing a user's record that has an array gives no single truth value
        return one is other


class UserValue(Value):
    """Base of records that users make. Lists and tuples of numbers are converted to arrays.

    Raises InputError if a value cannot be converted to an array of its field's shape.
    """

    def __post_init__(self) -> None:
        kind = type(self).__name__.lower()
        for name in (entry.name for entry in fields(self) if entry.type is Array):  # type: ignore[arg-type]
            value, shape = getattr(self, name), _SHAPES.get(name, (3,))
            self._set(**{name: as_floats(f"a {kind}'s {name}", value, shape)})


def axial_tensor(axial: float, transverse: float, axis: Array) -> Array:
    """Return the inertia tensor (3, 3) of a body with a symmetry axis (3,) [kg m²]."""
    return transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)


def shell_inertia(radius: float, mass: float, thickness: float = 0.0) -> float:
    """Return the moment of a homogeneous spherical shell about a diameter [kg m²].

    It is 2/5 m (a⁵ - b⁵)/(a³ - b³) with b = a - thickness, and 2/3 m a² if the thickness is 0.
    Raises InputError if the thickness is negative or larger than the radius.
    """
    if not 0 <= thickness <= radius:
        line = f"a shell's thickness must be from 0 to its radius {radius:g}, not {thickness:g} m"
        raise InputError(line)
    if thickness == 0:
        return 2 / 3 * mass * radius * radius
    b = 1 - thickness / radius
    # Numerator and denominator of (1 - b⁵)/(1 - b³) are divided by 1 - b, because for a thin shell
    # the differences would lose digits.
    ratio = (1 + b + b**2 + b**3 + b**4) / (1 + b + b**2)
    return 2 / 5 * mass * radius * radius * ratio


def wall_volume(radius: float, thickness: float) -> float:
    """Return the volume of a spherical wall with an outer radius and a thickness [m³]."""
    b = 1 - thickness / radius
    return 4 / 3 * math.pi * radius**2 * thickness * (1 + b + b * b)


@dataclass(frozen=True)
class Solid:
    """The mass, centre and inertia of a rigid body.

    Attributes
    ----------
    mass : float, kg
    centre : (3,), m
        Centre of mass.
    inertia : (3, 3), kg m²
        Inertia about the centre of mass.
    reach : float, m
        Largest distance of the solid's matter from the sphere's centre; 0 if unknown.
    shapes : tuple of Shape
        Shapes for pictures.
    """

    mass: float
    centre: Array
    inertia: Array
    reach: float = 0.0
    shapes: tuple[Any, ...] = ()

    def check_within(self, name: str, radius: float) -> None:
        """Raise InputError if the solid extends beyond a shell of this radius [m]."""
        if self.reach > radius * (1 + SYMMETRIC):
            beyond = f"{self.reach:.6g} m from the sphere's centre, but the radius is {radius:g} m"
            raise InputError(f"{name} reaches {beyond}; make the body smaller, or move it")

    def moments_about(self, name: str, axis: Array, otherwise: str) -> tuple[float, float]:
        """Return the axial and transverse moments [kg m²] about an axis (3,).

        Raises InputError if the solid is not symmetric. otherwise: the kind of body that the
        message suggests in that case.
        """
        axial = float(axis @ self.inertia @ axis)
        transverse = float(np.trace(self.inertia) - axial) / 2
        largest = float(np.abs(self.inertia).max())
        off = float(np.abs(self.inertia - axial_tensor(axial, transverse, axis)).max())
        if off > SYMMETRIC * largest:
            fault = f"its inertia of {largest:.6g} kg m² is off by {off:.6g} kg m²"
            raise InputError(f"{name} is not symmetric about its axis: {fault}; use a {otherwise}")
        # The moments of a disc have the ratio 2, up to rounding; a Rotor accepts no larger ratio.
        if axial < 2 * transverse * (1 + SYMMETRIC):
            axial = min(axial, 2 * transverse)
        return axial, transverse


def composed(solids: Iterable[Solid]) -> Solid:
    """Return several solids as one body."""
    solids = list(solids)
    mass = sum(solid.mass for solid in solids)
    centre = np.array([solid.mass / mass * solid.centre for solid in solids]).sum(axis=0)
    inertia = np.array([inertia_about(centre, solid) for solid in solids]).sum(axis=0)
    shapes = tuple(shape for solid in solids for shape in solid.shapes)
    return Solid(mass, centre, inertia, max(solid.reach for solid in solids), shapes)


def inertia_about(point: Array, body: "Solid | Body") -> Array:
    """Return a body's inertia (3, 3) about a point (3,), by Steiner's theorem [kg m²]."""
    r = body.centre - point
    return body.inertia + body.mass * (r @ r * np.eye(3) - np.outer(r, r))


@dataclass(frozen=True)
class _ShapedBody(UserValue):
    """A body with the shapes (`robotball.robot.shapes.Shape`) that pictures show [m]."""

    shapes: tuple[Any, ...] = field(default=(), compare=False, repr=False, kw_only=True)


@dataclass(frozen=True)
class Shell(_ShapedBody):
    """Describe the shell, the sphere that rolls. The frame turns about the shell's axis.

    Parameters
    ----------
    radius : float
        Radius a, m.
    mass : float
        Mass, kg.
    axial_inertia, transverse_inertia : float
        Moments of inertia about the axis and about a perpendicular line, both through the shell's
        centre of mass, kg m².
    axis : array (3,)
        Unit vector of the axis, in frame axes.
    offset : float, optional
        σ, the position of the centre of mass on the axis, measured from the sphere's centre, m.
    asymmetry : array (3, 3), optional
        For a shell that is not symmetric: a tensor that is added to the inertia, kg m².
    aside : array (3,), optional
        For a shell that is not symmetric: a vector that is added to the centre of mass, m.

    Examples
    --------
    >>> import robotball as rb
    >>> shell = rb.Shell(0.2, 0.5, axial_inertia=0.0133, transverse_inertia=0.0133, axis=(0, 0, 1))
    >>> shell.inertia.shape
    (3, 3)
    """

    radius: float
    mass: float
    axial_inertia: float
    transverse_inertia: float
    axis: Array
    offset: float = 0.0
    asymmetry: Array = field(default_factory=lambda: np.zeros((3, 3)))
    aside: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def centre(self) -> Array:
        """The centre of mass (3,) from the sphere's centre, frame axes [m]."""
        return self.offset * self.axis + self.aside

    @property
    def inertia(self) -> Array:
        """The inertia (3, 3) about the shell's centre of mass, frame axes [kg m²]."""
        return axial_tensor(self.axial_inertia, self.transverse_inertia, self.axis) + self.asymmetry


@dataclass(frozen=True)
class Frame(_ShapedBody):
    """Describe the body that turns inside the shell and carries rotors and pendulums.

    The frame's hinge lies along the shell's axis, through the sphere's centre.

    Parameters
    ----------
    mass : float
        Mass, kg.
    inertia : array (3, 3)
        Inertia about the frame's centre of mass, in frame axes, kg m².
    centre : array (3,), optional
        Centre of mass, measured from the sphere's centre, m.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> frame = rb.Frame(1.0, np.diag([0.004, 0.004, 0.003]), centre=(0.0, 0.0, -0.05))
    >>> frame.centre.tolist()
    [0.0, 0.0, -0.05]
    """

    mass: float
    inertia: Array
    centre: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Rotor(_ShapedBody):
    """Describe a body that the frame carries and that turns about its own symmetry axis.

    Parameters
    ----------
    mass : float
        Mass, kg.
    axial_inertia, transverse_inertia : float
        Moments of inertia about the axis and about a perpendicular line, both through the rotor's
        centre of mass, kg m².
    axis : array (3,)
        Unit vector of the axis, in frame axes.
    centre : array (3,), optional
        Centre of mass, measured from the sphere's centre, m.

    Examples
    --------
    >>> import robotball as rb
    >>> rotor = rb.Rotor(0.2, axial_inertia=4e-4, transverse_inertia=2e-4, axis=(1, 0, 0))
    >>> rotor.inertia.diagonal().tolist()
    [0.0004, 0.0002, 0.0002]
    """

    mass: float
    axial_inertia: float
    transverse_inertia: float
    axis: Array
    centre: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def inertia(self) -> Array:
        """The inertia (3, 3) about the rotor's centre of mass, frame axes [kg m²]."""
        return axial_tensor(self.axial_inertia, self.transverse_inertia, self.axis)


@dataclass(frozen=True)
class Pendulum(_ShapedBody):
    """Describe a body of any shape on a hinge of the frame. Values are those at hinge angle 0.

    Parameters
    ----------
    mass : float
        Mass, kg.
    inertia : array (3, 3)
        Inertia about the pendulum's centre of mass, in frame axes, kg m².
    centre : array (3,)
        Centre of mass, measured from the sphere's centre, m.
    axis : array (3,)
        Unit vector of the hinge's axis, in frame axes.
    pivot : array (3,), optional
        A point on the hinge's axis, measured from the sphere's centre, m.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> bob = rb.Pendulum(0.3, 1e-4 * np.eye(3), centre=(0.0, 0.0, -0.1), axis=(0, 1, 0))
    >>> bob.pivot.tolist()
    [0.0, 0.0, 0.0]
    """

    mass: float
    inertia: Array
    centre: Array
    axis: Array
    pivot: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Link(_ShapedBody):
    """Describe one body of a tree and its joint. Values are those with all joint angles 0.

    Parameters
    ----------
    name : str
        Name of the body.
    parent : str
        Name of the body to which the joint connects this one; "" for the shell, which has no joint.
    mass : float
        Mass, kg.
    inertia : array (3, 3)
        Inertia about the link's centre of mass, in frame axes, kg m².
    centre : array (3,)
        Centre of mass, measured from the sphere's centre, m.
    axis : array (3,)
        Unit vector of the joint's axis, in frame axes.
    pivot : array (3,), optional
        A point on the joint's axis, measured from the sphere's centre, m.
    slides : bool, optional
        True for a joint that moves the body along the axis instead of turning it.
    range : tuple of (str, float, float), optional
        For a joint with limits: its name, its least angle and its largest angle, rad, or m for a
        slide. The equations end a motion at a limit; other engines ignore the limits.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> arm = rb.Link("arm", "shell", 0.3, 1e-4 * np.eye(3), (0.0, 0.0, -0.1), axis=(0, 1, 0))
    >>> arm.massless
    False
    """

    name: str
    parent: str
    mass: float
    inertia: Array
    centre: Array
    axis: Array
    pivot: Array = field(default_factory=lambda: np.zeros(3))
    slides: bool = False
    range: tuple[str, float, float] | None = None

    @property
    def massless(self) -> bool:
        """True for a link without mass, which connects two joints of the same body."""
        return self.mass == 0 and not self.inertia.any()


Hung = Frame | Rotor | Pendulum | Link
Body = Shell | Hung


@dataclass(frozen=True)
class Hinge(Value):
    """Mount a body in the ball, with its motor, command and initial state.

    Parameters
    ----------
    body : Frame, Rotor, Pendulum or Link
        The body that turns. A frame turns relative to the shell, a rotor or pendulum relative to
        the frame, and a link relative to its parent.
    command : float, Drive, Custom or callable, optional
        Command of the motor as a function of time: a rate (rad/s), an angle (rad) or a torque
        (N m); for a slide m/s, m or N. Without a motor, the command is the rate of the hinge, which
        keeps this rate exactly.
    motor : Motor, optional
        Motor that applies a torque to the hinge.
    angle : float, optional
        Initial angle, rad; m for a slide.
    rate : float, optional
        Initial rate, rad/s; m/s for a slide. If None, the hinge starts at the commanded rate, or at
        rest if the command is not a rate. A hinge without a motor always starts at its commanded
        rate.

    Raises
    ------
    InputError
        If the angle or the rate is not finite.

    Examples
    --------
    >>> import robotball as rb
    >>> rotor = rb.Rotor(0.2, axial_inertia=4e-4, transverse_inertia=2e-4, axis=(1, 0, 0))
    >>> hinge = rb.Hinge(rotor, command=100.0, motor=rb.Servo(gain=0.5), rate=0.0)
    >>> hinge.motor.torque(hinge.command, 0.0, hinge.rate)
    np.float64(50.0)
    """

    body: Hung
    command: "Rate" = 0.0
    motor: "Motor | None" = None
    angle: float = 0.0
    rate: float | None = None

    def __post_init__(self) -> None:
        check_size("a hinge's initial angle", self.angle, "rad")
        if self.rate is not None:
            check_size("a hinge's initial rate", self.rate, "rad/s")
        if self.motor is None:  # the rate has no effect, so hinges that differ in it are equal
            self._set(rate=None)


@dataclass(frozen=True)
class Ball(Value):
    """Assemble a ball from a shell and the hinges that carry the other bodies.

    Vectors are in frame axes, which need not be principal axes, or in the shell's axes if the ball
    has no frame. The reduced equations need a balanced ball (its centre of mass is at the sphere's
    centre) whose only hinges are those of the frame and of rotors. Properties that depend on joint
    angles have their values at angle 0.

    Parameters
    ----------
    shell : Shell
        The sphere that rolls.
    hinges : tuple of Hinge
        The hinges. The frame's hinge comes first, if there is a frame, and a link's hinge comes
        after the hinge of its parent. Motions list hinge angles and rates in this order.

    Raises
    ------
    InputError
        If the bodies do not form a tree, or if a body has a mass and inertia that no rigid body can
        have.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> shell = rb.Shell(0.2, 0.5, 0.0133, 0.0133, axis=(0, 0, 1))
    >>> frame = rb.Frame(1.0, np.diag([0.004, 0.004, 0.003]))
    >>> ball = rb.Ball(shell, (rb.Hinge(frame, command=2.0),))
    >>> ball.mass, ball.rotors
    (1.5, ())
    """

    shell: Shell
    hinges: tuple[Hinge, ...] = ()

    def __post_init__(self) -> None:
        check_positive("the shell's radius", self.shell.radius, "m")
        self._check_tree()
        for name, body in self.named_bodies:
            _check_body(name, body)
        # The sum can fail although each body passes: in rotated axes, a rounding error can exceed
        # the least moment of a needle.
        _check_inertia("the ball", self.inertia)

    def _check_tree(self) -> None:
        """Raise InputError unless every body is mounted on one that comes before it."""
        names = [name for name, _ in self.named_bodies]
        if repeated := [name for name in names if names.count(name) > 1]:
            raise InputError(f"two bodies are called {repeated[0]!r}")
        for i, (name, body) in enumerate(self.named_bodies):
            if isinstance(body, Rotor | Pendulum) and not self.has_frame:
                raise InputError(
                    "rotors and pendulums need a frame; a ball without one takes links"
                )
            if isinstance(body, Frame) and i > 1:
                raise InputError(f"the frame carries all other bodies: put it before {names[1]}")
            if isinstance(body, Link) and body.parent not in names[:i]:
                before = f"only {', '.join(names[:i])} come before {name}; put its parent there"
                raise InputError(f"{name} is joined to {body.parent!r}, but {before}")

    def with_hinges(self, **given: "Mapping[str, Any] | Sequence[Any] | Array") -> "Ball":
        """Return a copy of the ball with new values for fields of its hinges.

        Parameters
        ----------
        **given
            New values for a field of `Hinge`, such as `command={"frame": 2.0}`: a mapping from
            names of bodies to values, or a sequence with one value per hinge.

        Returns
        -------
        Ball
            The new ball. Hinges that are not named keep their values.

        Raises
        ------
        InputError
            If there is no body with a given name, or a sequence does not have one value per hinge.
        """
        changes: dict[str, dict[str, Any]] = {link.name: {} for link in self.tree[1:]}
        for key, values in given.items():
            if not isinstance(values, Mapping):
                count = len(changes)
                if len(values) != count:
                    raise InputError(f"{count} hinges need {count} {key}s, not {len(values)}")
                values = dict(zip(changes, values, strict=True))
            for name, value in values.items():
                if name not in changes:
                    raise unknown("hinge", name, changes)
                changes[name][key] = value
        pairs = zip(self.hinges, changes.values(), strict=True)
        return replace(self, hinges=tuple(replace(hinge, **change) for hinge, change in pairs))

    @cached_property
    def has_frame(self) -> bool:
        return any(isinstance(hinge.body, Frame) for hinge in self.hinges)

    @property
    def frame(self) -> Frame:
        """The frame. The ball must have one, see `has_frame`."""
        return next(hinge.body for hinge in self.hinges if isinstance(hinge.body, Frame))

    @property
    def rotors(self) -> tuple[Rotor, ...]:
        return tuple(hinge.body for hinge in self.hinges if isinstance(hinge.body, Rotor))

    @property
    def pendulums(self) -> tuple[Pendulum, ...]:
        return tuple(hinge.body for hinge in self.hinges if isinstance(hinge.body, Pendulum))

    @property
    def links(self) -> tuple[Link, ...]:
        return tuple(hinge.body for hinge in self.hinges if isinstance(hinge.body, Link))

    @property
    def general(self) -> bool:
        """True if the ball has links or an asymmetric shell, which the paper does not describe."""
        shell = self.shell
        return bool(self.links or shell.asymmetry.any() or shell.aside.any()) or not self.has_frame

    @cached_property
    def named_bodies(self) -> tuple[tuple[str, Body], ...]:
        """(name, body) of the shell and of every hinge's body; engines use these names."""
        counts = {Rotor: itertools.count(1), Pendulum: itertools.count(1)}
        named: list[tuple[str, Body]] = [("shell", self.shell)]
        for body in (hinge.body for hinge in self.hinges):
            if isinstance(body, Rotor | Pendulum):
                name = f"{type(body).__name__.lower()}{next(counts[type(body)])}"
            else:
                name = body.name if isinstance(body, Link) else "frame"
            named.append((name, body))
        return tuple(named)

    @cached_property
    def tree(self) -> tuple[Link, ...]:
        """All bodies as links, the shell first and parents before their children.

        The shell has no joint; the axis of its link is that of the frame's joint.
        """
        return tuple(self._link(name, body) for name, body in self.named_bodies)

    def _link(self, name: str, body: Body) -> Link:
        if isinstance(body, Link):
            return body
        parent = {"shell": "", "frame": "shell"}.get(name, "frame")
        axis, pivot = self.shell.axis, np.zeros(3)
        if isinstance(body, Rotor | Pendulum):
            axis, pivot = body.axis, body.pivot if isinstance(body, Pendulum) else body.centre
        return Link(name, parent, body.mass, body.inertia, body.centre, axis, pivot)

    @property
    def radius(self) -> float:
        return self.shell.radius

    @cached_property
    def mass(self) -> float:
        return float(sum(body.mass for _, body in self.named_bodies))

    @cached_property
    def d(self) -> float:
        """d = m a² [kg m²], with the ball's mass m and radius a."""
        return self.mass * self.radius**2

    @cached_array
    def inertia(self) -> Array:
        """The inertia (3, 3) of the whole ball about the sphere's centre, frame axes [kg m²]."""
        about_centre = [inertia_about(np.zeros(3), body) for _, body in self.named_bodies]
        return np.array(about_centre).sum(axis=0)

    @cached_array
    def centre_of_mass(self) -> Array:
        """The centre of mass (3,) from the centre of the sphere, frame axes [m]."""
        moment = np.array([body.mass * body.centre for _, body in self.named_bodies]).sum(axis=0)
        return np.asarray(moment / self.mass)

    @cached_property
    def principal(self) -> tuple[Array, Array]:
        """Principal moments I (3,) and axes, the columns of a rotation (3, 3), frame axes.

        The axes of a diagonal inertia keep their order, which eigh would change.
        """
        moments = np.diag(self.inertia)
        # Because of rounding, a sum of diagonal tensors, some of them rotated, is not exactly
        # diagonal.
        if np.abs(self.inertia - np.diag(moments)).max() <= 1e-14 * moments.sum():
            return moments, read_only(np.eye(3))
        moments, axes = np.linalg.eigh(self.inertia)
        # eigh may return a reflection, which no quaternion can express.
        return read_only(moments), read_only(axes if np.linalg.det(axes) > 0 else -axes)

    @cached_array
    def A(self) -> Array:
        """(I + d E)⁻¹ (3, 3) in frame axes [1/(kg m²)]."""
        return np.linalg.inv(self.inertia + self.d * np.eye(3)).astype(np.float64)

    @cached_array
    def gyrostatic_inertia(self) -> Array:
        """Matrix (3, 1 + rotors) of (A.3) that maps hinge rates to k, frame axes [kg m²].

        k = Σ j φ̇ n - J_s Ω. The first column is for the frame's rate, the others for the rotors.
        """
        shell = -self.shell.axial_inertia * self.shell.axis
        return np.stack([shell, *(r.axial_inertia * r.axis for r in self.rotors)], axis=1)


def imbalance(ball: Ball) -> str | None:
    """Return a message if the centre of mass is off the sphere's centre, else None."""
    offset = float(np.linalg.norm(ball.centre_of_mass))
    if offset <= ROUNDING * ball.radius:
        return None
    return f"the ball is not balanced: its centre of mass is {offset:.6g} m off the sphere's centre"


def beyond_the_shell(ball: Ball) -> list[str]:
    """Return a message for each body that needs mass outside the sphere.

    If all mass of a body is within the radius a, then tr(I)/2 = Σ m r² <= m a² about the sphere's
    centre. A pendulum is tested at its worst angle.
    """
    messages = []
    for name, body in ball.named_bodies:
        # The mean square distance of a body's mass from its centre of mass. Links may be massless.
        spread = float(np.trace(body.inertia)) / 2 / (body.mass or 1.0)
        reach = math.hypot(math.sqrt(spread), _furthest(body))
        if reach > ball.radius * (1 + ROUNDING):
            where = f"at {reach:.4g} m, beyond {ball.radius:g} m; check the inertia and centre"
            messages.append(f"{name} has mass outside the shell: {where}")
    return messages


def _furthest(body: Body) -> float:
    """Return the largest distance [m] of the centre of mass from the sphere's centre."""
    if not isinstance(body, Pendulum):  # the position of a link depends on all its parents
        return float(np.linalg.norm(body.centre))
    # The centre of mass moves on a circle about the axis. At the worst angle, the circle's radius
    # points away from the sphere's centre, so the radius and the axis's distance add up.
    n, arm = body.axis, body.centre - body.pivot
    height = float(n @ body.centre)
    circle = float(np.linalg.norm(np.cross(n, arm)))
    return math.hypot(height, circle + float(np.linalg.norm(np.cross(n, body.pivot))))


def _check_body(name: str, body: Body) -> None:
    """Raise InputError unless a rigid body can have these numbers."""
    massless = isinstance(body, Link) and body.massless
    if not massless:
        check_positive(f"{name}'s mass", body.mass, "kg")
    if not isinstance(body, Frame):
        length = math.hypot(*body.axis.tolist())  # does not overflow
        if not abs(length - 1) <= ROUNDING:
            raise InputError(f"{name}'s axis must be a unit vector; its length is {length:.17g}")
    for coordinate in body.centre.tolist():
        check_size(f"{name}'s centre", coordinate, "m")
    if isinstance(body, Link | Pendulum):
        for coordinate in body.pivot.tolist():
            check_size(f"{name}'s pivot", coordinate, "m")
    if isinstance(body, Shell | Rotor):
        _check_entries(name, np.array([body.axial_inertia, body.transverse_inertia]))
    if isinstance(body, Rotor):
        # The triangle inequality for two equal moments, with the numbers that the user gave.
        axial, transverse = body.axial_inertia, body.transverse_inertia
        if not axial <= 2 * transverse * (1 + ROUNDING):
            excess = f"{axial:.6g} > 2 * {transverse:.6g} by {axial - 2 * transverse:.6g} kg m²"
            raise InputError(f"{name}'s axial_inertia exceeds 2 * transverse_inertia: {excess}")
    if not massless:
        _check_inertia(name, body.inertia)


def _check_inertia(name: str, inertia: Array) -> None:
    """Raise InputError unless a rigid body can have this tensor (3, 3)."""
    _check_entries(name, inertia)
    if np.abs(inertia - inertia.T).max() > ROUNDING * np.abs(inertia).max():
        raise InputError(f"{name}'s inertia is not symmetric: {inertia.tolist()}")
    small, middle, large = np.linalg.eigvalsh(inertia)
    if small <= 0:
        raise InputError(f"{name}'s least principal moment must be positive, not {small:g} kg m²")
    if small < 1 / _LARGEST_MOMENT:
        limit = f"at least {1 / _LARGEST_MOMENT:g}, not {small:.6g} kg m²"
        raise InputError(f"{name}'s least principal moment must be {limit}")
    # Each moment is Σ m (x² + y²), so it cannot exceed the sum of the other two.
    if large - small - middle > ROUNDING * large:
        excess = f"{large:.6g} exceeds {small:.6g} + {middle:.6g} by {large - small - middle:.6g}"
        raise InputError(f"{name}'s inertia has an impossible principal moment: {excess} kg m²")


def _check_entries(name: str, inertia: Array) -> None:
    if not np.all(np.isfinite(inertia)):
        raise InputError(f"{name}'s inertia has an entry that is not finite: {inertia.tolist()}")
    check_size(f"{name}'s inertia", float(np.abs(inertia).max()), "kg m²", _LARGEST_MOMENT)
