"""Every script in docs/rolling/ has the error of its engine's row in docs/engines.md."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robotball import integrate, load_scene
from tests.docs.test_findings import printed_by

DOCS = Path(__file__).parents[2] / "docs"
SCRIPTS = {file.stem: file.read_text() for file in (DOCS / "rolling").glob("*.py")}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_has_the_error_of_its_row(name: str, tmp_path: Path) -> None:
    """Its label names the row's preset and step; its version line names the engine."""
    printed = printed_by(DOCS / f"rolling/{name}.py", tmp_path)
    engine, table = printed.pop("version").rpartition(" ")[0], (DOCS / "engines.md").read_text()
    ((label, error),) = printed.items()
    preset, step = label.split(", ")
    title = rf"\[{engine}[^|\]]*, {preset}\]\(rolling/{name}\.py\)"
    (row,) = re.findall(rf"(?m)^\| {title} \| {step} \| ([^ ]+) \|", table)
    assert 1 / 1.5 < float(error) / float(row) < 1.5


def equations(script: str) -> str:
    """Return the scene and its equations, without the bodies, which not every script has."""
    (ours,) = re.findall(r"(?ms)^E, A, K.+^omega = .+?$", script)
    return re.sub(r"(?m)^(SHELL|AXIS|ROTOR|FRAME).*\n", "", ours)


def test_scripts_are_short_self_contained_and_linked() -> None:
    """At most 80 lines, no import of robotball, and the same equations in all."""
    page = (DOCS / "engines.md").read_text()
    assert len({equations(script) for script in SCRIPTS.values()}) == 1
    for name, script in SCRIPTS.items():
        assert f"[`{name}.py`](rolling/{name}.py)" in page
        assert len(script.splitlines()) <= 80
        assert not re.search(r"^\s*(import|from) (robotball|validation)", script, re.M)


def test_the_scripts_equations_are_right() -> None:
    """Their solution is the equations' motion of fig12, and not with another momentum or rate."""
    theory = integrate(load_scene("fig12"), np.linspace(0, 10, 501))
    ours = equations(SCRIPTS["drake_rolls"])

    def error(equations: str) -> float:
        names: dict[str, Any] = {"np": np, "solve_ivp": solve_ivp}
        exec(equations, names)
        difference = np.linalg.norm(names["truth"] - theory.contact_point, axis=1)
        return float(difference.max() / theory.path_scale)

    assert error(ours) < 1e-9  # measured 6e-12, from the tolerance of solve_ivp
    assert error(ours.replace("5 * (h", "4.99 * (h")) > 1e-4
    assert error(ours.replace("0, 2.0])", "0, 1.99])")) > 1e-4
