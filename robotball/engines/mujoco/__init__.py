"""The ball as a contact model in MuJoCo."""

import mujoco

from robotball.motion import Label

# The version of the library, whose package mujoco-core may be newer than the bindings.
LABEL = Label("MuJoCo", mujoco.mj_versionString(), "#0072B2", "o")  # blue of Okabe and Ito's set
