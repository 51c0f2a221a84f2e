"""Run a rolling robot ball in contact engines and with the paper's equations, and compare.

    import robotball as rb

    scene = rb.load_scene("fig12")    # a name in rb.catalog(), or the path of a robot file
    theory = rb.integrate(scene)      # motion computed with the equations
    motion = rb.simulate(scene, 5.0)  # motion simulated with MuJoCo for 5 s
    agreement = rb.compare(scene, settings="balanced")  # both motions, their errors, a verdict
    print(agreement.path_error, motion.report)

`compare` and the studies are implemented in the package `validation`, which imports this one.
"""

import os
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import lazy_loader

# The names in __init__.pyi are imported on first use.
_loaded, _, _own = lazy_loader.attach_stub(__name__, __file__)
# Imported from `validation`.
_EVERYDAY = ("Agreement", "assert_agrees", "check_robot", "compare", "compare_many", "sweep")
__all__ = sorted([*_own, *_EVERYDAY])


def __dir__() -> list[str]:
    return __all__


def validation_package(module: str = "") -> ModuleType:
    """Import the validation package, or one of its modules such as ".cli".

    A wheel installs it inside this package, because `validation` may be the name of another
    package; in the checkout it is a sibling folder.
    """
    inside = Path(__file__).with_name("validation").is_dir()
    return import_module(f"{__name__}.validation{module}" if inside else f"validation{module}")


def __getattr__(name: str) -> object:
    if name in _EVERYDAY:
        return getattr(validation_package(), name)
    try:
        return _loaded(name)
    except (AttributeError, RuntimeError, ImportError) as error:
        # If MUJOCO_GL names a missing OpenGL, importing MuJoCo fails with an AttributeError, which
        # Python would report as an unknown name of this package.
        if os.environ.get("MUJOCO_GL"):
            from robotball.errors import InputError
            from robotball.view.gl import advice, ended_import

            if ended_import(error):
                raise InputError(advice()) from None
        raise error from None


# Display scenes and motions as notebook cells.
if (shell := getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()) is not None:
    from robotball.view.notebook import register

    register(shell)
