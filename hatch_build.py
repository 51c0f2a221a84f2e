"""Put the package `validation` into `robotball` in a wheel, where its own name is anybody's.

PyPI has a package `validation`, and pip lets two packages write the same files in silence. In the
checkout it stays beside `robotball`. Its modules import each other by their full names, which are
written anew for the wheel; an editable installation is the checkout.
"""

import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# In an import, and at the beginning of a string that names a module.
_NAMED = re.compile(r"""(?<=from )validation(?=[.\w]* import)|(?<=["'])validation(?=\.)""")


def renamed(text: str) -> str:
    """Return the text of a module with `validation` inside `robotball`."""
    return _NAMED.sub("robotball.validation", text)


class RenamingHook(BuildHookInterface):
    """Writes the renamed modules, and the command that starts in them, into the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        self.folder = Path(tempfile.mkdtemp())
        home, leave = self.folder / "validation", shutil.ignore_patterns("__pycache__")
        shutil.copytree(Path(self.root) / "validation", home, ignore=leave)
        for file in home.rglob("*.py"):
            file.write_text(renamed(file.read_text(encoding="utf-8")), encoding="utf-8")
        build_data["force_include"][str(home)] = "robotball/validation"
        scripts = self.metadata.core.scripts
        scripts["robotball"] = "robotball." + scripts["robotball"]

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            shutil.rmtree(self.folder)
