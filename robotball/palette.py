"""One colour an engine, the same in every picture; told apart in grey by their brightness."""

MUJOCO = "#0072B2"
EQUATIONS = "#D55E00"
