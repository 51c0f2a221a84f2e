"""Every engine against the equations: each in a process, and where it has one an environment."""
