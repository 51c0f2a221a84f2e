"""The mechanics of any robot in the shell: its bodies, momenta, energy and loads."""
