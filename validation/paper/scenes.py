"""The catalog's scenes of the paper, for what the paper says of them."""

import warnings
from functools import cache

from robotball import Scene, SceneWarning, load_scene


@cache
def paper_scene(name: str) -> Scene:
    """A scene of the catalog; that its ball cannot be built is a claim of its own, no warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        return load_scene(name)
