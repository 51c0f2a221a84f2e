"""Studies of the contact models, a file each, with the command that runs it."""
