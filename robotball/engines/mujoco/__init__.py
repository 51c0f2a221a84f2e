"""The ball as a contact model in MuJoCo: composed, checked, stepped, monitored and read."""

from importlib.metadata import version

from robotball.motion import Label

LABEL = Label("MuJoCo", version("mujoco"), "#0072B2", "o")  # blue of Okabe and Ito's set
