"""The ball's bodies and hinges, and the few numbers that the equations need of them (Appendix A).

In order: records with arrays, which are equal where their numbers are; inertias of simple bodies
and of bodies put together; the bodies of a ball; its hinges; the ball; checks of what a rigid body
can be.
"""

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


class Value:
    """Base of dataclasses with arrays: equal to one of the same type with equal fields.

    Arrays are equal number by number, NaN to NaN; fields with compare=False do not count. Such a
    record has no hash, because arrays have none. Its arrays are read-only: it was checked when it
    was made.
    """

    def __post_init__(self) -> None:
        self.__setstate__({})

    def __setstate__(self, state: dict[str, Any]) -> None:
        # A copy, or what another process sends, has arrays that can be written.
        own = vars(self)
        own |= state
        own |= {name: read_only(each) for name, each in own.items() if isinstance(each, np.ndarray)}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # Set on the class itself: a dataclass writes its own __eq__ over one that is inherited, and
        # that one asks arrays for a single truth value, which they do not have.
        cls.__eq__ = _equal  # type: ignore[method-assign]


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view of an array through which it cannot be written."""
    view = array.view()
    view.flags.writeable = False
    return view


def cached_array(compute: Callable[[Any], Array]) -> "cached_property[Array]":
    """Make a cached property of a method that returns an array, which is read-only."""

    @wraps(compute)
    def protected(self: Any) -> Array:
        return read_only(compute(self))

    return cached_property(protected)


def _equal(one: Any, other: Any) -> Any:
    if type(one) is not type(other):
        return NotImplemented
    return all(
        _same(getattr(one, each.name), getattr(other, each.name))
        for each in fields(one)
        if each.compare
    )


def _same(one: Any, other: Any) -> bool:
    """Return whether two values are equal; arrays, also in tuples, are compared by number."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        one, other = np.asarray(one), np.asarray(other)
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    try:
        return bool(one == other)
    except ValueError:  # a user's own record with an array has no single truth value
        return one is other


# Hand-written MJCF of the floor and of the bodies: a wheel has the folder inside the package, a
# checkout beside it.
_INSIDE, _BESIDE = (folder / "mjcf" for folder in Path(__file__).parents[1:3])
PARTS = _INSIDE if _INSIDE.is_dir() else _BESIDE
# The largest error by which an inertia may miss a condition, relative to its largest part: a tensor
# that was computed has some roundings of 1e-16, a wrong one misses by far more.
ROUNDING = 1e-12
_LARGEST_MOMENT = LARGEST**3  # kg m², of a mass times a length squared; the least is as far below 1


def axial_tensor(axial: float, transverse: float, axis: Array) -> Array:
    """Return the inertia tensor (3, 3) of a body with a symmetry axis (3,) [kg m²]."""
    return transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)


def thick_shell_inertia(radius: float, mass: float, thickness: float) -> float:
    """Return 2/5 m (a⁵ - b⁵)/(a³ - b³), a homogeneous shell from b = a - thickness to a [kg m²].

    Raises InputError unless 0 < thickness <= radius.
    """
    if not 0 < thickness <= radius:
        raise InputError(
            f"a shell's thickness must be positive and at most its radius {radius:g}, not "
            f"{thickness:g} m"
        )
    b = 1 - thickness / radius
    # (1 - b⁵)/(1 - b³) divided by 1 - b, which cancels to nothing for a thin shell.
    ratio = (1 + b + b**2 + b**3 + b**4) / (1 + b + b**2)
    return 2 / 5 * mass * radius * radius * ratio


def shell_inertia(radius: float, mass: float, thickness: float = 0.0) -> float:
    """Return the moment of a homogeneous shell about a diameter, 2/3 m a² of a thin one [kg m²]."""
    if thickness == 0:  # the limit of a thick shell, whose formula takes none
        return 2 / 3 * mass * radius * radius
    return thick_shell_inertia(radius, mass, thickness)


@dataclass(frozen=True)
class Solid:
    """A mass [kg], its centre (3,) [m] and the inertia (3, 3) about that centre [kg m²].

    reach [m]: how far from the sphere's centre its matter lies, where that is known, else 0.
    shapes: as of a body.
    """

    mass: float
    centre: Array
    inertia: Array
    reach: float = 0.0
    shapes: tuple[Any, ...] = ()


def composed(solids: Iterable[Solid]) -> Solid:
    """Return several solids as one body."""
    solids = list(solids)
    mass = sum(each.mass for each in solids)
    centre = np.array([each.mass / mass * each.centre for each in solids]).sum(axis=0)
    inertia = np.array([inertia_about(centre, each) for each in solids]).sum(axis=0)
    shapes = tuple(shape for each in solids for shape in each.shapes)
    return Solid(mass, centre, inertia, max(each.reach for each in solids), shapes)


def inertia_about(point: Array, body: "Solid | Body") -> Array:
    """Return a body's inertia (3, 3) about a point (3,), by Steiner's theorem [kg m²]."""
    r = body.centre - point
    return body.inertia + body.mass * (r @ r * np.eye(3) - np.outer(r, r))


_SHAPES = {"inertia": (3, 3), "asymmetry": (3, 3), "attitude": (4,)}  # others have three numbers


class Given(Value):
    """Base of what users make: numbers in lists and tuples are taken for arrays.

    Raises InputError for what is no array, or of another shape than the field's.
    """

    def __post_init__(self) -> None:
        for each in fields(self):  # type: ignore[arg-type]
            if each.type is not Array:
                continue
            value = getattr(self, each.name)
            what = f"a {type(self).__name__.lower()}'s {each.name}"
            array = as_floats(what, value, _SHAPES.get(each.name, (3,)))
            object.__setattr__(self, each.name, read_only(array))


@dataclass(frozen=True)
class _Built(Given):
    """A body, with the shapes (`robotball.robot.shapes.Shape`) [m] that pictures show."""

    shapes: tuple[Any, ...] = field(default=(), compare=False, repr=False, kw_only=True)


@dataclass(frozen=True)
class Shell(_Built):
    """Describe the sphere that rolls, about whose axis the frame turns.

    Parameters
    ----------
    radius : float
        Radius a, m.
    mass : float
        kg.
    axial_inertia, transverse_inertia : float
        Moments about the axis and across it, through the shell's own centre of mass, kg m².
    axis : array (3,)
        Unit vector, frame axes.
    offset : float, optional
        σ, how far the centre of mass is along the axis from the sphere's centre, m.
    asymmetry : array (3, 3), optional
        What is added to the inertia of a shell that is not symmetric, kg m².
    aside : array (3,), optional
        What is added to the centre of mass of such a shell, m.

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
        """The inertia (3, 3) about the shell's own centre of mass, frame axes [kg m²]."""
        return axial_tensor(self.axial_inertia, self.transverse_inertia, self.axis) + self.asymmetry


@dataclass(frozen=True)
class Frame(_Built):
    """Describe the body that turns inside the shell and carries rotors and pendulums.

    Its hinge lies along the shell's axis, through the sphere's centre.

    Parameters
    ----------
    mass : float
        kg.
    inertia : array (3, 3)
        About the frame's own centre of mass, frame axes, kg m².
    centre : array (3,), optional
        Centre of mass, from the sphere's centre, m.

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
class Rotor(_Built):
    """Describe a symmetric body that turns on the frame about its own axis.

    Parameters
    ----------
    mass : float
        kg.
    axial_inertia, transverse_inertia : float
        Moments about the axis and across it, through the rotor's own centre of mass, kg m².
    axis : array (3,)
        Unit vector, frame axes.
    centre : array (3,), optional
        Centre of mass, from the sphere's centre, m.

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
        """The inertia (3, 3) about the rotor's own centre of mass, frame axes [kg m²]."""
        return axial_tensor(self.axial_inertia, self.transverse_inertia, self.axis)


@dataclass(frozen=True)
class Pendulum(_Built):
    """Describe any body on a hinge of the frame, as it is at the hinge's angle 0.

    Parameters
    ----------
    mass : float
        kg.
    inertia : array (3, 3)
        About the pendulum's own centre of mass, frame axes, kg m².
    centre : array (3,)
        Centre of mass, from the sphere's centre, m.
    axis : array (3,)
        The hinge's unit vector, frame axes.
    pivot : array (3,), optional
        A point of the hinge's axis, from the sphere's centre, m.

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
class Link(_Built):
    """Describe any body of the tree with its joint, as they are where all joints are at 0.

    Parameters
    ----------
    name : str
        The body's own name.
    parent : str
        Name of the body that it is joined to; "" of the shell, which is joined to none.
    mass : float
        kg.
    inertia : array (3, 3)
        About the link's own centre of mass, frame axes, kg m².
    centre : array (3,)
        Centre of mass, from the sphere's centre, m.
    axis : array (3,)
        The joint's unit vector, frame axes.
    pivot : array (3,), optional
        A point of a hinge's axis, from the sphere's centre, m.
    slides : bool, optional
        Whether the joint moves the body along the axis, and does not turn it.
    range : tuple of (str, float, float), optional
        Name, least and largest angle of a joint that has limits, rad or m. The equations end a
        motion there, while engines let the joint go on.

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
        """True for a link between two joints of one body."""
        return self.mass == 0 and not self.inertia.any()


Hung = Frame | Rotor | Pendulum | Link
Body = Shell | Hung


@dataclass(frozen=True)
class Hinge(Value):
    """Hang a body in the ball, and say how it is moved and how it starts.

    Parameters
    ----------
    body : Frame, Rotor, Pendulum or Link
        A frame turns relative to the shell, rotors and pendulums relative to the frame, a link
        relative to its parent.
    command : float, Drive, Custom or callable, optional
        What the motor takes, as a function of time: a rate (rad/s), an angle (rad), a torque
        (N m). Without a motor it is the rate, which the hinge keeps exactly. Of a slide in m and N.
    motor : Motor, optional
        What moves the hinge by a torque.
    angle : float, optional
        At the start, rad; m of a slide.
    rate : float, optional
        At the start, rad/s; m/s of a slide. If None it is the commanded rate, or 0 where the
        command is none. A hinge without a motor always starts at its commanded rate.

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
        check_size("a hinge's angle at the start", self.angle, "rad")
        if self.rate is not None:
            check_size("a hinge's rate at the start", self.rate, "rad/s")
        if self.motor is None:  # equal hinges are equal records
            object.__setattr__(self, "rate", None)


@dataclass(frozen=True)
class Ball(Value):
    """Put a ball together: its shell, and the hinges by which other bodies hang in it.

    Vectors have the frame's axes, which are not always principal ones, or the shell's axes in a
    ball without a frame. The reduced equations need a balanced ball, its centre of mass at the
    centre of the sphere, with a frame and rotors only. Numbers that change with a joint are those
    at its angle 0.

    Parameters
    ----------
    shell : Shell
        The sphere that rolls.
    hinges : tuple of Hinge
        The frame's first, where there is one, and every link's after its parent's. In this order
        motions have the hinges' angles and rates.

    Raises
    ------
    InputError
        If the bodies do not make a tree, or a rigid body cannot have the numbers of one of them.

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
            massless = isinstance(body, Link) and body.massless
            if not massless:
                check_positive(f"{name}'s mass", body.mass, "kg")
            if not isinstance(body, Frame):
                _check_unit(f"{name}'s axis", body.axis)
            for coordinate in body.centre.tolist():
                check_size(f"{name}'s centre", coordinate, "m")
            if isinstance(body, Shell | Rotor):
                _check_entries(name, np.array([body.axial_inertia, body.transverse_inertia]))
            if isinstance(body, Link | Pendulum):
                for coordinate in body.pivot.tolist():
                    check_size(f"{name}'s pivot", coordinate, "m")
            if isinstance(body, Rotor):
                _check_no_flatter_than_a_disk(name, body)
            if not massless:
                check_inertia(name, body.inertia)
        # The sum may fail where the bodies pass: in turned axes a needle's least moment is lost to
        # rounding.
        check_inertia("the ball", self.inertia)

    def _check_tree(self) -> None:
        """Raise InputError unless every body hangs on one that comes before it."""
        names = [name for name, _ in self.named_bodies]
        if twice := [name for name in names if names.count(name) > 1]:
            raise InputError(f"two bodies are called {twice[0]!r}")
        for i, (name, body) in enumerate(self.named_bodies):
            if isinstance(body, Rotor | Pendulum) and not self.has_frame:
                raise InputError(
                    "rotors and pendulums turn on a frame; a ball without one takes links"
                )
            if isinstance(body, Frame) and i > 1:
                raise InputError(f"the frame carries the others: put it before {names[1]}")
            if isinstance(body, Link) and body.parent not in names[:i]:
                raise InputError(
                    f"{name} hangs on {body.parent!r}, which is no body before it; the bodies "
                    f"before it are {', '.join(names[:i])}"
                )

    def with_hinges(self, **given: "Mapping[str, Any] | Sequence[Any] | Array") -> "Ball":
        """Return the ball with other bodies, commands, motors, angles or rates of its hinges.

        Parameters
        ----------
        **given
            By the name of a field of `Hinge`: a mapping from names of bodies to their new values,
            or a value for each hinge, in order.

        Returns
        -------
        Ball
            Hinges that are not named stay as they are.

        Raises
        ------
        InputError
            If no body has such a name, or there is not a value for each hinge.
        """
        changes: dict[str, dict[str, Any]] = {link.name: {} for link in self.tree[1:]}
        for what, values in given.items():
            if not isinstance(values, Mapping):
                count = len(changes)
                if len(values) != count:
                    raise InputError(f"{count} hinges need as many {what}s, not {len(values)}")
                values = dict(zip(changes, values, strict=True))
            for name, value in values.items():
                if name not in changes:
                    raise unknown("hinge", name, changes)
                changes[name][what] = value
        hinges = zip(self.hinges, changes.values(), strict=True)
        return replace(self, hinges=tuple(replace(each, **own) for each, own in hinges))

    @cached_property
    def has_frame(self) -> bool:
        return any(isinstance(hinge.body, Frame) for hinge in self.hinges)

    @property
    def frame(self) -> Frame:
        """The frame of a ball that has one."""
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
        """True with links, or a shell that is not symmetric, which the paper does not describe."""
        shell = self.shell
        return bool(self.links or shell.asymmetry.any() or shell.aside.any()) or not self.has_frame

    @cached_property
    def named_bodies(self) -> tuple[tuple[str, Body], ...]:
        """(name, body) of the shell and of every hinge's body, as engines name them."""
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
        """All bodies as links, the shell first and every parent before what hangs on it.

        The joint of the shell, which has none, is that of the frame.
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
        """M a² [kg m²]: the ball's mass as seen from the contact point."""
        return self.mass * self.radius**2

    @cached_array
    def inertia(self) -> Array:
        """The whole ball's inertia (3, 3) about the sphere's centre, frame axes [kg m²]."""
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

        Axes that are principal already are kept, in their own order, as users expect of a diagonal
        inertia; eigh would sort them.
        """
        moments = np.diag(self.inertia)
        # A sum of diagonal tensors, some turned about a coordinate axis, is diagonal to roundings.
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
        """(3, 1 + rotors) of (A.3), frame axes [kg m²]: k is this times the hinges' rates.

        k = Σ j φ̇ n - J_s Ω, for the frame's rate about the shell's axis, then the rotors'.
        """
        shell = -self.shell.axial_inertia * self.shell.axis
        return np.stack([shell, *(each.axial_inertia * each.axis for each in self.rotors)], axis=1)


def imbalance(ball: Ball) -> str | None:
    """Return one line where the centre of mass is off the sphere's centre, else None."""
    offset = float(np.linalg.norm(ball.centre_of_mass))
    if offset <= ROUNDING * ball.radius:
        return None
    return f"the ball is not balanced: its centre of mass is {offset:.6g} m off the sphere's centre"


def beyond_the_shell(ball: Ball) -> list[str]:
    """Return a line for each body that needs mass outside the sphere, as no workshop can build it.

    For mass within the radius a, tr(I)/2 = Σ m r² about the centre of the sphere is at most m a².
    A pendulum is judged at its worst angle.
    """
    lines = []
    for name, body in ball.named_bodies:
        # Of all its mass the mean square distance from its own centre of mass, and that centre's
        # distance; a link may have no mass.
        spread = float(np.trace(body.inertia)) / 2 / (body.mass or 1.0)
        reach = math.hypot(math.sqrt(spread), _furthest(body))
        if reach > ball.radius * (1 + ROUNDING):
            lines.append(
                f"{name} has mass outside the shell: at {reach:.4g} m, beyond {ball.radius:g} m; "
                "check its inertia and centre"
            )
    return lines


def _furthest(body: Body) -> float:
    """Return how far the centre of mass may get from the sphere's centre, at any angle [m]."""
    if not isinstance(body, Pendulum):  # where a link gets depends on all that carry it
        return float(np.linalg.norm(body.centre))
    # The centre goes round a circle in a plane across the axis. Both the circle's radius and the
    # axis's distance count, as at the worst angle they point the same way.
    n, arm = body.axis, body.centre - body.pivot
    height = float(n @ body.centre)
    circle = float(np.linalg.norm(np.cross(n, arm)))
    return math.hypot(height, circle + float(np.linalg.norm(np.cross(n, body.pivot))))


def check_inertia(name: str, inertia: Array) -> None:
    """Raise InputError unless a rigid body can have this tensor (3, 3)."""
    _check_entries(name, inertia)
    if np.abs(inertia - inertia.T).max() > ROUNDING * np.abs(inertia).max():
        raise InputError(f"{name}'s inertia is not symmetric: {inertia.tolist()}")
    small, middle, large = np.linalg.eigvalsh(inertia)
    if small <= 0:
        raise InputError(
            f"{name}'s inertia is not positive: its smallest principal moment is {small:.6g} kg m²"
        )
    if small < 1 / _LARGEST_MOMENT:
        raise InputError(
            f"{name}'s smallest principal moment must be at least {1 / _LARGEST_MOMENT:g}, not "
            f"{small:.6g} kg m²"
        )
    # Each moment is Σ m (x² + y²), so that no one exceeds the sum of the other two.
    if large - small - middle > ROUNDING * large:
        raise InputError(
            f"{name}'s inertia breaks the triangle inequality: {large:.6g} > {small:.6g} + "
            f"{middle:.6g} by {large - small - middle:.6g} kg m²; no body of positive mass has it"
        )


def _check_entries(name: str, inertia: Array) -> None:
    if not np.all(np.isfinite(inertia)):
        raise InputError(f"{name}'s inertia has an entry that is not finite: {inertia.tolist()}")
    check_size(f"{name}'s inertia", float(np.abs(inertia).max()), "kg m²", _LARGEST_MOMENT)


def _check_unit(what: str, axis: Array) -> None:
    length = math.hypot(*axis.tolist())  # overflows nowhere
    if not abs(length - 1) <= ROUNDING:
        raise InputError(f"{what} must be a unit vector; its length is {length:.17g}")


def _check_no_flatter_than_a_disk(name: str, rotor: Rotor) -> None:
    # The triangle inequality for two equal moments, said in the author's numbers.
    axial, transverse = rotor.axial_inertia, rotor.transverse_inertia
    if not axial <= 2 * transverse * (1 + ROUNDING):
        raise InputError(
            f"{name} is flatter than a disk: its axial inertia {axial:.6g} exceeds twice the "
            f"transverse {transverse:.6g} by {axial - 2 * transverse:.6g} kg m²"
        )
