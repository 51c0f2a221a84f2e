"""What the plane does to the shell besides carrying it, where a scene says so."""

from dataclasses import dataclass

from robotball.errors import check_not_negative, check_positive


@dataclass(frozen=True)
class Friction:
    """Coefficients of friction between shell and plane; None is as much as the motion needs.

    sliding    1, the largest friction over the normal force
    torsional  m, the largest torque about the vertical over the normal force
    rolling    m, the torque against rolling over the normal force; 0 is none
    """

    sliding: float | None = None
    torsional: float | None = None
    rolling: float = 0.0

    def __post_init__(self) -> None:
        if self.sliding is not None:
            check_positive("the sliding friction", self.sliding, "")
        if self.torsional is not None:
            check_positive("the torsional friction", self.torsional, "m")
        check_not_negative("the rolling friction", self.rolling, "m")
