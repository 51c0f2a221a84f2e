"""The ball as a contact model in MuJoCo: composed, checked, stepped, monitored and read."""

import mujoco

from robotball.motion import Label

# The library's own version: its package, mujoco-core, may be newer than that of the bindings.
LABEL = Label("MuJoCo", mujoco.mj_versionString(), "#0072B2", "o")  # blue of Okabe and Ito's set
