"""Scenes as files: TOML in and out, and frames from a user's own MJCF."""
