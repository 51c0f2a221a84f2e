"""robotball: a rolling ball run by contact engines and by the paper's equations, side by side."""

import os

import lazy_loader

# What is named in __init__.pyi is loaded when it is first used.
_loaded, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    try:
        return _loaded(name)
    except (AttributeError, RuntimeError, ImportError) as error:
        # Python would take an AttributeError of MuJoCo's import to say that this module has no such
        # name. Only where MUJOCO_GL names an OpenGL does that import fail so.
        if os.environ.get("MUJOCO_GL"):
            from robotball.errors import InputError
            from robotball.film.gl import advice, ended_import

            if ended_import(error):
                raise InputError(advice()) from None
        raise error from None
