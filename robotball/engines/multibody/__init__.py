"""Ideal rolling of any robot in the shell: Scene → Motion, by the formulas of mechanics."""

from importlib.metadata import version

from robotball.motion import Label

LABEL = Label("multibody equations", version("robotball"), "#D55E00")  # the equations' vermillion
