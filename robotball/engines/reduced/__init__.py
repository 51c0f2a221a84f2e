"""The paper's reduced equations: Scene → Motion, and many motions at once by compiled steps."""

from importlib.metadata import version

from robotball.motion import Label

LABEL = Label("equations", version("robotball"), "#D55E00")  # vermillion of Okabe and Ito's set
