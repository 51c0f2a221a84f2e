"""Files: scenes in TOML, bodies of MJCF and URDF, trajectories, exports for other simulators."""
