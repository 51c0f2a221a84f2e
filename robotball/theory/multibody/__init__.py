"""The equations of any robot that rolls, and their integration."""

from importlib.metadata import version

from robotball.motion import Label

LABEL = Label("multibody equations", version("robotball"), "#D55E00", "P")  # vermillion
