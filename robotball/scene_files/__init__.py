"""Scene files: how `load_scene` reads scene files, and what the keys of scene files mean."""
