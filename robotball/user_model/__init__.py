"""Read a user's own MJCF or URDF file safely, make a scene of it, and correct it."""
