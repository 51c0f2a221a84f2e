"""Shell, frame and rotors, and the parameters A, K, d and Ω of the equations."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robotball.robot.ball import (
    Ball,
    Frame,
    Hinge,
    Hung,
    Link,
    Pendulum,
    Rotor,
    Shell,
    UserValue,
    Value,
    axial_tensor,
    beyond_the_shell,
    shell_inertia,
)
from robotball.robot.formulas import parameters_of
from robotball.robot.motors import Servo
from robotball.robot.scene import Start
from robotball.rotations import Array
from tests.messages import unnamed
from tests.random_balls import cloud_inertia
from tests.random_robots import random_robot
from tests.vectors import Y, Z, gap

TILTED = np.array([0.6, 0.0, 0.8])
SHELL = Shell(radius=0.5, mass=2.0, axial_inertia=0.3, transverse_inertia=0.2, axis=Z)
FRAME = Frame(mass=1.0, inertia=np.diag([0.1, 0.2, 0.25]))
ROTOR = Rotor(mass=0.5, axial_inertia=0.02, transverse_inertia=0.01, axis=TILTED)
BALL = Ball(SHELL, (Hinge(FRAME), Hinge(ROTOR)))
PENDULUM = Pendulum(0.5, 0.01 * np.eye(3), 0.1 * Y, TILTED)
LINK = Link("arm", "shell", 0.5, 0.01 * np.eye(3), 0.1 * Y, TILTED)
START = Start(np.array([0.6, 0.8, 0.0, 0.0]), Y)


@given(
    st.sampled_from((SHELL, FRAME, ROTOR, PENDULUM, LINK, START)), st.sampled_from((list, tuple))
)
def test_lists_and_tuples_are_converted_to_arrays(record: UserValue, kind: type) -> None:
    """In every field of every body and of a start: the records are equal."""
    names = [field.name for field in fields(record)]  # type: ignore[arg-type]
    arrays = {name: getattr(record, name) for name in names}
    lists = {
        n: kind(map(kind, a) if a.ndim > 1 else a)
        for n, a in arrays.items()
        if isinstance(a, np.ndarray)
    }
    again = replace(record, **lists)  # type: ignore[type-var]
    assert len(lists) >= 2
    assert again == record
    assert all(getattr(again, name).dtype == float for name in lists)


@dataclass(frozen=True)
class Named(Value):
    """A record with any value."""

    value: Any


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        ((1.0, np.array([2.0, np.nan])), (1.0, np.array([2.0, np.nan])), True),
        ((1.0, np.ones(2)), (1.0, np.array([1.0, 1.1])), False),
        (np.ones(2), np.ones(3), False),
        ((1.0, 2.0), (1.0,), False),
        ((1.0, 2.0), 1.0, False),
    ],
)
def test_records_are_equal_if_their_numbers_are(one: Any, other: Any, equal: bool) -> None:
    """Arrays are compared by value, also in tuples; NaN equals NaN."""
    assert (Named(one) == Named(other)) is equal


def inertia_of(masses: Array, places: Array) -> Array:
    """Σ m (r² E - r⊗r) (3, 3)."""
    squares = np.einsum("ni,ni->n", places, places)
    return (masses * squares).sum() * np.eye(3) - places.T @ (masses[:, None] * places)


def test_principal_axes_diagonalize_the_inertia() -> None:
    """Axes diag(I) axesᵀ is the inertia, the axes are a rotation, and A, K, Ω refer to them."""
    rng = np.random.default_rng(1)
    for _ in range(30):
        ball = BALL.with_hinges(body={"frame": Frame(1.0, cloud_inertia(rng, 1.0, 0.4))})
        moments, axes = ball.principal
        # Rounding: measured 1e-15 of the size, then 1.1e-15, 7.8e-16, 3.6e-15, 3.1e-15, 7.1e-15.
        size = np.trace(ball.inertia)
        assert gap(axes @ np.diag(moments) @ axes.T, ball.inertia) < 1e-14 * size
        assert gap(axes @ axes.T, np.eye(3)) < 5e-15
        assert np.linalg.det(axes) > 0
        p = parameters_of(ball, "rubber", rates := [rng.uniform(-5, 5), rng.uniform(-200, 200)])
        assert gap(axes @ np.diag(p.A) @ axes.T, ball.A) < 5e-15
        Omega = rates[0] * Z
        k = rates[1] * 0.02 * TILTED - 0.3 * Omega
        assert gap(axes @ p.Omega, Omega) < 1e-14
        assert gap(axes @ p.k, k) < 3e-14
        assert gap(axes @ p.K, k - ball.mass * 0.25 * Omega) < 3e-14


def test_a_diagonal_inertia_is_not_sorted() -> None:
    """Axes that are principal already keep their order."""
    ball = Ball(SHELL, (Hinge(Frame(1.0, np.diag([0.3, 0.1, 0.25]))),))
    moments, axes = ball.principal
    np.testing.assert_array_equal(axes, np.eye(3))
    np.testing.assert_array_equal(moments, np.diag(ball.inertia))


def test_mass_centre_and_inertia_equal_the_sums_over_equivalent_points() -> None:
    """m, the centre of mass, I about the centre of the sphere, and d = m a².

    Each body is replaced with six points on its principal axes. Measured 1e-16: rounding.
    """
    rng = np.random.default_rng(2)
    for _ in range(10):
        ball = random_robot(rng, 1, 1)
        masses, places = [], []
        for _, body in ball.named_bodies:
            moments, axes = np.linalg.eigh(body.inertia)
            arms = np.sqrt(3 * (moments.sum() / 2 - moments) / body.mass) * axes
            masses += [body.mass / 6] * 6
            places += [body.centre + sign * arm for sign in (1, -1) for arm in arms.T]
        m, r = np.array(masses), np.array(places)
        assert ball.mass == pytest.approx(m.sum(), rel=1e-14)
        assert ball.d == pytest.approx(m.sum() * ball.radius**2, rel=1e-14)
        assert gap(ball.centre_of_mass, m @ r / m.sum()) < 1e-15
        assert gap(ball.inertia, inertia_of(m, r)) < 1e-15
    names = [name for name, _ in ball.named_bodies]
    assert names == ["shell", "frame", "rotor1", "pendulum1"]


def test_mass_outside_the_shell_is_found_at_any_hinge_angle() -> None:
    """The largest distance over a full rotation, for random pivots and centres of a pendulum."""
    rng = np.random.default_rng(6)
    for _ in range(5):
        pivot, centre = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3)
        pendulum = Pendulum(0.1, 1e-3 * np.eye(3), centre, TILTED, pivot)
        turns = Rotation.from_rotvec(np.outer(np.linspace(0, 2 * np.pi, 20_001), TILTED))
        reach = np.linalg.norm(pivot + turns.apply(centre - pivot), axis=1).max()
        # The mean square distance of its mass from its centre is half the trace over the mass.
        whole = np.hypot(reach, np.sqrt(1.5e-3 / 0.1))
        shell = replace(SHELL, radius=0.1)
        (*_, message) = beyond_the_shell(Ball(shell, (Hinge(FRAME), Hinge(pendulum))))
        assert unnamed(f"pendulum1 shell {whole:.4g}~m 0.1~m", message) == []


def test_axial_tensor_has_its_moments() -> None:
    """I n = axial n, and I v = transverse v for v perpendicular to n."""
    for v, moment in ((TILTED, 0.3), (Y, 0.2), (np.cross(TILTED, Y), 0.2)):
        assert gap(axial_tensor(0.3, 0.2, TILTED) @ v, moment * v) < 1e-15


def test_thin_shell_has_the_inertia_of_points_on_the_sphere() -> None:
    """⅔ m a², as for six equal points on the coordinate axes."""
    places = 0.3 * np.concatenate([np.eye(3), -np.eye(3)])
    inertia = inertia_of(np.full(6, 0.7 / 6), places)
    assert gap(inertia, shell_inertia(0.3, 0.7) * np.eye(3)) < 1e-16


def test_hinges_are_changed_by_name_or_in_order() -> None:
    """Other hinges do not change; removing a motor removes the initial rate."""
    servo = Servo(gain=1.0)
    changes: dict[str, Any] = {
        "command": {"rotor1": 2.0},
        "motor": {"rotor1": servo},
        "rate": {"rotor1": 3.0},
    }
    by_name = BALL.with_hinges(**changes)
    assert by_name.hinges == (BALL.hinges[0], Hinge(ROTOR, 2.0, servo, rate=3.0))
    in_order = by_name.with_hinges(angle=np.array([0.1, 0.2]))
    assert in_order.hinges == (Hinge(FRAME, angle=0.1), Hinge(ROTOR, 2.0, servo, 0.2, 3.0))
    assert by_name.with_hinges(motor=(None, None)).hinges[1] == Hinge(ROTOR, 2.0)
    assert by_name != BALL != in_order


def test_bodies_may_be_listed_in_any_order() -> None:
    """Rotors and pendulums are numbered separately; every body but the frame hangs on the frame."""
    pendulum = Pendulum(0.1, 1e-3 * np.eye(3), np.zeros(3), TILTED)
    bodies: list[Hung] = [FRAME, pendulum, ROTOR, pendulum]
    ball = Ball(SHELL, tuple(map(Hinge, bodies)))
    names = ["shell", "frame", "pendulum1", "rotor1", "pendulum2"]
    assert [link.name for link in ball.tree] == names
    assert [link.parent for link in ball.tree] == ["", "shell", "frame", "frame", "frame"]
    assert (ball.rotors, ball.pendulums) == ((ROTOR,), (pendulum, pendulum))
