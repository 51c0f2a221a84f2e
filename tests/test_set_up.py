"""`make setup` installs all that is needed, on a Python that is supported."""

import re
import tomllib
from importlib.util import find_spec

from tests.imports import PROJECT

PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text())


def test_every_python_from_3_11_to_3_14_is_taken() -> None:
    """By the package and by the Makefile alike."""
    (by_make,) = re.findall(r"^PYTHON_RANGE := (.*)$", (PROJECT / "Makefile").read_text(), re.M)
    assert by_make == PYPROJECT["project"]["requires-python"] == ">=3.11,<3.15"


def test_labmaze_is_left_out() -> None:
    """dm-control asks for it, has no use for it here, and no newer Python has a wheel of it."""
    lock = (PROJECT / "requirements.lock").read_text()
    assert re.findall(r"^labmaze.*(?=\\)", lock, re.M) == [
        "labmaze==1.0.6 ; sys_platform == 'never' "
    ]
    assert find_spec("labmaze") is None
    assert find_spec("dm_control.mjcf") is not None
