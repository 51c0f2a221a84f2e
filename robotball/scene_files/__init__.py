"""Scene files: how `load_scene` reads them, and what their keys mean."""
