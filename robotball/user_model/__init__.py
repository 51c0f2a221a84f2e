"""A user's own MJCF or URDF file: read safely, run as a scene, and corrected."""
