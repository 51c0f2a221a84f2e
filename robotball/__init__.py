"""A rolling ball run by contact engines and by the paper's equations, side by side.

    import robotball as rb

    scene = rb.load_scene("fig12")        # a name of rb.catalog(), or the path of a robot's file
    theory = rb.integrate(scene)          # the motion by the equations
    motion = rb.simulate(scene, 5.0)      # the motion by MuJoCo, for 5 s
    agreement = rb.compare(scene, settings="balanced")  # both motions, their errors, a verdict
    print(agreement.path_error, motion.report)

`compare` and the studies are in the package `validation`, which comes with this one and stands on
it. Here are its everyday names alone.
"""

import os
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import lazy_loader

# What is named in __init__.pyi is loaded when it is first used.
_loaded, _, _own = lazy_loader.attach_stub(__name__, __file__)
# Of `validation`, which needs all of this.
_EVERYDAY = ("Agreement", "assert_agrees", "compare", "compare_many", "sweep")
__all__ = sorted([*_own, *_EVERYDAY])


def __dir__() -> list[str]:
    return __all__


def validation_package(module: str = "") -> ModuleType:
    """Import the validation package, or its module of a name such as ".cli".

    It lies in this package if a wheel was installed, as `validation` may then be the name of
    another package, and beside this package in the checkout.
    """
    inside = Path(__file__).with_name("validation").is_dir()
    return import_module(f"{__name__}.validation{module}" if inside else f"validation{module}")


def __getattr__(name: str) -> object:
    if name in _EVERYDAY:
        return getattr(validation_package(), name)
    try:
        return _loaded(name)
    except (AttributeError, RuntimeError, ImportError) as error:
        # Python would take an AttributeError of MuJoCo's import to say that this module has no such
        # name. Only where MUJOCO_GL names an OpenGL does that import fail so.
        if os.environ.get("MUJOCO_GL"):
            from robotball.errors import InputError
            from robotball.view.gl import advice, ended_import

            if ended_import(error):
                raise InputError(advice()) from None
        raise error from None


# A notebook shows scenes and motions as cells.
if (shell := getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()) is not None:
    from robotball.view.notebook import register

    register(shell)
