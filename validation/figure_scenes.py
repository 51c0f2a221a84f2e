"""The scenes behind the paper's figures: those of the catalog, and balls made for the rest.

The paper gives A, Ω and K of a ball but no bodies; any bodies that have them will do. Those of
Figs 5 to 10 cannot be built, for mass would have to lie outside the shell; MuJoCo runs them.
"""

import numpy as np

from robotball import Scene
from robotball.bodies import Ball, Frame, Rotor, Shell, thin_shell_inertia
from robotball.equations import Vector
from robotball.parameters import Parameters
from robotball.rotations import Array
from robotball.start import Start, along_momentum, attitude_of_axes

# Of the ball's mass; the frame has the rest. Light enough to leave a frame that can exist.
SHELL_PART, ROTOR_PART = 0.05, 0.05
RADIUS = 1.0  # m
ROTOR_INERTIA = 0.02  # kg m² for a ball of 1 kg

AT_REST_A, AT_REST_OMEGA, AT_REST_MASS = (0.5, 0.4, 0.3), (4.0, 2.0, 1.0), 0.9  # Figs 5 to 8
# Figs 9, 10. Of all orders of these three numbers, this alone makes f = 2.0806 the limit.
LINE_A, LINE_K, LINE_MASS = (0.5, 0.3, 0.6), (4.0, 5.0, 0.0), 0.2
LINE_OMEGA = (0.0, 0.0, 2.0)  # its size is chosen: the limit does not depend on it


def ball_with(A: Vector, Omega: Vector, K: Vector, mass: float) -> tuple[Ball, float, float]:
    """A ball with diagonal A [1/(kg m²)], its frame's rate about Ω and its rotor's rate [rad/s].

    Omega rad/s, not zero; K kg m²/s. One rotor along K + (J_s + d)Ω gives K. Raises InputError
    where no frame is left that can exist.
    """
    rate = float(np.linalg.norm(Omega))
    axis, d = np.array(Omega) / rate, mass * RADIUS**2
    shell_inertia = thin_shell_inertia(RADIUS, SHELL_PART * mass)
    shell = Shell(RADIUS, SHELL_PART * mass, shell_inertia, shell_inertia, axis)
    spin = np.array(K) + (shell_inertia + d) * np.array(Omega)
    inertia = ROTOR_INERTIA * mass
    size = float(np.linalg.norm(spin))
    rotor = Rotor(ROTOR_PART * mass, inertia, inertia / 2, spin / size)
    rest = np.diag(1 / np.array(A) - d) - shell.inertia - rotor.inertia
    frame = Frame((1 - SHELL_PART - ROTOR_PART) * mass, rest)
    return Ball(shell, frame, (rotor,)), rate, size / inertia


def parameters_with(A: Vector, Omega: Vector, K: Vector, mass: float) -> Parameters:
    """The numbers of a rubber ball with diagonal A, Ω, K and mass [kg], whatever its bodies."""
    d = mass * RADIUS**2
    return Parameters("rubber", (1 / A[0] - d, 1 / A[1] - d, 1 / A[2] - d), d, RADIUS, Omega, K)


def from_rest(name: str, K3: float, gamma: Array, duration: float) -> Scene:
    """A ball of Figs 5 to 8, K = (0, 0, K₃), that starts with M = 0 at γ (3,)."""
    ball, frame_rate, rotor_rate = ball_with(AT_REST_A, AT_REST_OMEGA, (0.0, 0.0, K3), AT_REST_MASS)
    gamma = gamma / np.linalg.norm(gamma)
    # OX lies where the contact point would start to, were it not for the frame's own turning.
    across = np.cross(gamma, np.array(AT_REST_OMEGA))
    start = Start(attitude_of_axes(gamma, across / np.linalg.norm(across)), np.zeros(3))
    title = f"Motion from rest, K₃ = {K3:g}"
    return _scene(name, title, ball, frame_rate, rotor_rate, start, duration)


def straight_line(name: str, f: float, tilt: float, duration: float) -> Scene:
    """The ball of Fig. 10, M² = f, started `tilt` off the straight-line motion σ₊.

    γ ∝ σ₊ + tilt e₃, and M = √f along the part of e₃ across γ.
    """
    ball, frame_rate, rotor_rate = ball_with(LINE_A, LINE_OMEGA, LINE_K, LINE_MASS)
    gamma = line_verticals(f)["σ₊"] + tilt * np.eye(3)[2]
    gamma /= np.linalg.norm(gamma)
    M = np.eye(3)[2] - gamma[2] * gamma
    start = along_momentum(gamma, np.sqrt(f) * M / np.linalg.norm(M))
    return _scene(name, f"Turning round, f = {f:g}", ball, frame_rate, rotor_rate, start, duration)


def line_verticals(f: float, K: Vector = LINE_K) -> dict[str, Array]:
    """γ (3,) of the straight-line motions σ± (M along e₃) and δ± (against it), Ω along e₃.

    There ω = 0, so γ is across Ω and M = γ×K, whose square is f: (K,γ)² = K² - f.
    """
    size, angle = np.hypot(K[0], K[1]), np.arctan2(K[1], K[0])
    off = np.arcsin(np.sqrt(f) / size)
    turns = {"σ₊": -off, "σ₋": off + np.pi, "δ₊": off, "δ₋": np.pi - off}
    return {
        name: np.array([np.cos(angle + turn), np.sin(angle + turn), 0.0])
        for name, turn in turns.items()
    }


def _scene(
    name: str,
    title: str,
    ball: Ball,
    frame_rate: float,
    rotor_rate: float,
    start: Start,
    duration: float,
) -> Scene:
    source = "A, Ω and K of the paper; bodies chosen to have them"
    return Scene(name, title, source, ball, "rubber", frame_rate, (rotor_rate,), start, duration)
