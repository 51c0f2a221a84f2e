"""Shell, frame and rotors, and the numbers A, K, d and Ω that the equations know of them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.equations import parameters_of
from robotball.robot import (
    Ball,
    Frame,
    Rotor,
    Shell,
    axial_tensor,
    check_inertia,
    thin_shell_inertia,
)
from robotball.rotations import Array

NAN, INF = float("nan"), float("inf")
Z_AXIS = np.array([0.0, 0.0, 1.0])
SHELL = Shell(radius=0.5, mass=2.0, axial_inertia=0.3, transverse_inertia=0.2, axis=Z_AXIS)
FRAME = Frame(mass=1.0, inertia=np.diag([0.1, 0.2, 0.25]))
ROTOR = Rotor(mass=0.5, axial_inertia=0.02, transverse_inertia=0.01, axis=np.array([0.6, 0.0, 0.8]))
BALL = Ball(SHELL, FRAME, (ROTOR,))


def gap(a: ArrayLike, b: ArrayLike) -> float:
    """The largest difference of two arrays' entries."""
    return float(np.abs(np.asarray(a) - np.asarray(b)).max())


# A ball of any bodies ------------------------------------------------------------------------


@st.composite
def clouds(draw: st.DrawFn) -> tuple[Array, Array]:
    """Masses (n,) and places (n, 3) of mass points that do not lie nearly in one plane or line."""
    n = draw(st.integers(4, 6))
    masses = draw(npst.arrays(float, n, elements=st.floats(0.1, 2.0)))
    places = draw(npst.arrays(float, (n, 3), elements=st.floats(-1.0, 1.0)))
    assume(np.linalg.eigvalsh(places.T @ places)[0] > 1e-3)
    return masses, places


def inertia_of(masses: Array, places: Array) -> Array:
    """Σ m (r² E - r⊗r) (3, 3)."""
    squares = np.einsum("ni,ni->n", places, places)
    return (masses * squares).sum() * np.eye(3) - places.T @ (masses[:, None] * places)


@pytest.mark.slow
@given(cloud=clouds())
def test_inertia_of_any_mass_points_is_accepted(cloud: tuple[Array, Array]) -> None:
    """`check_inertia` passes whatever masses can have."""
    check_inertia("a cloud", inertia_of(*cloud))


@pytest.mark.slow
@given(cloud=clouds(), excess=st.floats(1e-6, 0.5), angle=st.floats(-3.0, 3.0))
def test_inertia_beyond_the_triangle_inequality_is_refused_by_its_excess(
    cloud: tuple[Array, Array], excess: float, angle: float
) -> None:
    """Large = small + middle + excess is refused and the message says by how much."""
    small, middle, _ = np.linalg.eigvalsh(inertia_of(*cloud))
    R = Rotation.from_euler("xyz", [angle, 2 * angle, 1.0]).as_matrix()
    inertia = R @ np.diag([small, middle, small + middle + excess]) @ R.T
    with pytest.raises(rb.InputError, match="breaks the triangle inequality") as caught:
        check_inertia("the frame", (inertia + inertia.T) / 2)
    said = str(caught.value).split(" by ")[1].split(" kg")[0]
    # Six digits are printed; the eigenvalues' rounding is below 1e-9 of the least excess.
    assert float(said) == pytest.approx(excess, rel=1e-5)


@pytest.mark.slow
@given(cloud=clouds(), rate=st.floats(-5.0, 5.0), rotor_rate=st.floats(-200.0, 200.0))
def test_principal_axes_give_the_inertia_back(
    cloud: tuple[Array, Array], rate: float, rotor_rate: float
) -> None:
    """Axes diag(I) axesᵀ is the inertia, axes are a rotation, and A, K, Ω are turned into them."""
    ball = replace(BALL, frame=Frame(float(cloud[0].sum()), inertia_of(*cloud)))
    moments, axes = ball.principal
    # Rounding: measured 1e-15 of the size, then 1.1e-15, 7.8e-16, 3.6e-15, 3.1e-15, 7.1e-15.
    size = np.trace(ball.inertia)
    assert gap(axes @ np.diag(moments) @ axes.T, ball.inertia) < 1e-14 * size
    assert gap(axes @ axes.T, np.eye(3)) < 5e-15
    assert np.linalg.det(axes) > 0
    p = parameters_of(ball, "rubber", [rate, rotor_rate])
    assert gap(axes @ np.diag(p.A) @ axes.T, ball.A) < 5e-15
    Omega = np.array([0.0, 0.0, rate])
    k = rotor_rate * 0.02 * np.array([0.6, 0.0, 0.8]) - 0.3 * Omega
    assert gap(axes @ p.Omega, Omega) < 1e-14
    assert gap(axes @ p.k, k) < 3e-14
    assert gap(axes @ p.K, k - ball.mass * 0.25 * Omega) < 3e-14


def test_axes_that_are_principal_keep_their_order() -> None:
    """A diagonal inertia is taken as it is, not sorted."""
    ball = Ball(SHELL, Frame(1.0, np.diag([0.3, 0.1, 0.25])), ())
    moments, axes = ball.principal
    np.testing.assert_array_equal(axes, np.eye(3))
    np.testing.assert_array_equal(moments, np.diag(ball.inertia))


def test_mass_and_inertia_are_the_sums_of_the_bodies() -> None:
    """m = Σ m, I = Σ I, d = m a² with the shell's radius."""
    assert BALL.mass == 3.5
    assert BALL.d == 3.5 * 0.25
    expected = np.diag([0.2 + 0.1, 0.2 + 0.2, 0.3 + 0.25]) + ROTOR.inertia
    assert gap(BALL.inertia, expected) < 1e-15
    assert [name for name, _ in BALL.named_bodies] == ["shell", "frame", "rotor1"]


def test_axial_tensor_has_its_moments() -> None:
    """I n = axial n, and I v = transverse v for v at a right angle to n."""
    tensor = axial_tensor(0.3, 0.2, np.array([0.6, 0.0, 0.8]))
    assert gap(tensor @ [0.6, 0.0, 0.8], 0.3 * np.array([0.6, 0, 0.8])) < 1e-15
    assert gap(tensor @ [0.0, 1.0, 0.0], [0.0, 0.2, 0.0]) < 1e-15
    assert gap(tensor @ [0.8, 0.0, -0.6], 0.2 * np.array([0.8, 0, -0.6])) < 1e-15


def test_thin_shell_has_the_inertia_of_points_on_the_sphere() -> None:
    """⅔ m a²: a cloud of points on the sphere's 20 dodecahedral corners has just that."""
    golden = (1 + 5**0.5) / 2
    corners = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    for u, v in [(s / golden, t * golden) for s in (-1, 1) for t in (-1, 1)]:
        corners += [(0.0, u, v), (u, v, 0.0), (v, 0.0, u)]
    places = 0.3 * np.array(corners) / 3**0.5
    inertia = inertia_of(np.full(20, 0.7 / 20), places)
    assert gap(inertia, thin_shell_inertia(0.3, 0.7) * np.eye(3)) < 1e-16


# What cannot be a ball ---------------------------------------------------------------------


REFUSED: list[tuple[str, Mapping[str, object], str]] = [
    *(
        (body, {"mass": bad}, f"{body}'s mass must be positive and finite, not .*kg")
        for body in ("shell", "frame", "rotor1")
        for bad in (0.0, -1.0, NAN, INF)
    ),
    *(
        ("shell", {"radius": bad}, "the shell's radius must be positive and finite")
        for bad in (0.0, -1.0, NAN, INF)
    ),
    *(
        ("frame", {"inertia": np.array(inertia)}, message)
        for inertia, message in (
            (np.diag([0.1, 0.2, 0.5]), r"0\.5 > 0\.1 \+ 0\.2 by 0\.2 kg m²"),
            (np.diag([0.1, 0.1, -0.1]), r"not positive: its smallest .* moment is -0\.1 kg m²"),
            (np.diag([0.1, 0.1, 0.0]), "not positive: its smallest principal moment is 0 kg m²"),
            ([[0.1, 0.05, 0], [0, 0.1, 0], [0, 0, 0.1]], "frame's inertia is not symmetric"),
            (np.diag([0.1, NAN, 0.1]), "frame's inertia has an entry that is not finite"),
            (np.diag([0.1, INF, 0.1]), "frame's inertia has an entry that is not finite"),
        )
    ),
    *(
        (body, {"axial_inertia": 0.5, "transverse_inertia": 0.2}, message)
        for body, message in (
            ("shell", r"shell's inertia .*: 0\.5 > 0\.2 \+ 0\.2 by 0\.1"),
            (
                "rotor1",
                r"rotor1 is flatter than a disk: .* exceeds twice the .* 0\.2 by 0\.1 kg m²",
            ),
        )
    ),
    *(
        (body, {"axis": np.array(axis)}, f"{body}'s (axis must be a unit vector|inertia)")
        for body in ("shell", "rotor1")
        for axis in ([0.0, 0.0, 2.0], [0.0, 0.0, 0.0], [NAN, 0.0, 1.0])
    ),
]


@pytest.mark.parametrize(("body", "changes", "message"), REFUSED)
def test_a_body_that_cannot_be_is_refused(
    body: str, changes: Mapping[str, object], message: str
) -> None:
    """By its name, with the value, the unit and by how much."""
    with pytest.raises(rb.InputError, match=message):
        with_body(body, **changes)


def test_disc_is_a_body_in_spite_of_rounding() -> None:
    """Axial = 2 transverse, the limit of the inequality, is accepted in any direction."""
    for seed in range(50):
        axis = np.random.default_rng(seed).normal(size=3)
        axis /= np.linalg.norm(axis)
        check_inertia("a disc", axial_tensor(0.2, 0.1, axis))


def with_body(name: str, **changes: object) -> Ball:
    """BALL with one body changed."""
    if name == "shell":
        return replace(BALL, shell=replace(SHELL, **changes))  # type: ignore[arg-type]
    if name == "frame":
        return replace(BALL, frame=replace(FRAME, **changes))  # type: ignore[arg-type]
    return replace(BALL, rotors=(replace(ROTOR, **changes),))  # type: ignore[arg-type]
