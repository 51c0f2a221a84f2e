"""Ideal rolling of any robot in the shell: Scene → Motion, by the equations of any robot."""
