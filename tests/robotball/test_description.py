"""A design is described in lines of words."""

from robotball import Limits
from robotball.designing import describe
from tests.robotball.designs import UNBUILDABLE, fig12


def test_a_description_lists_bodies_rates_and_the_verdict() -> None:
    """A line for the ball, for each body, and for the verdict; thickness where there is one."""
    made = fig12(limits=Limits(rotor_speed=18.5, rotor_radius=0.9, shell_thickness=0.001))
    lines = describe(made).splitlines()
    heads = ["ball ", "shell ", "frame ", "rotor1 ", "rotor2 ", "can be built"]
    assert [line.startswith(head) for line, head in zip(lines, heads, strict=True)] == [True] * 6
    assert f"mass {made.ball.mass:.6g} kg" in lines[0]
    assert "0.001 m thick" in lines[1]
    assert "2 rad/s" in lines[2]
    assert "ring of radius 0.9 m" in lines[3]
    assert "18.5 rad/s" in lines[4]
    assert UNBUILDABLE in describe(fig12(A=(0.5, 0.4, 0.3)))
