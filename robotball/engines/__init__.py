"""The engines: each rolls scenes in its own file or folder, and none imports another."""
