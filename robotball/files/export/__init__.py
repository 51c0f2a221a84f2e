"""A scene as other simulators take it: plain JSON, MJCF, URDF, SDF, and the conventions."""
