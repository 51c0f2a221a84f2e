"""Each script in docs/rolling/ rolls the ball of Fig. 12 as its engine's row in docs/engines.md."""

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
def test_a_script_gets_the_error_of_its_row(name: str, tmp_path: Path) -> None:
    """Its label has the row's preset and step, its version the engine's name."""
    found = printed_by(DOCS / f"rolling/{name}.py", tmp_path)
    engine, table = found.pop("version").split()[0], (DOCS / "engines.md").read_text()
    ((label, error),) = found.items()
    preset, step = label.split(", ")
    row, *_ = re.findall(rf"(?m)^\| {engine} \S+, {preset} \| {step} \| ([^ ]+) \|", table)
    assert 1 / 1.5 < float(error) / float(row) < 1.5


def equations(script: str) -> str:
    """The scene and its equations, without the bodies, which not every script needs."""
    (ours,) = re.findall(r"(?ms)^E, A, K.+^turning = .+?$", script)
    return re.sub(r"(?m)^(SHELL|AXIS|ROTOR|FRAME).*\n", "", ours)


def test_a_script_is_short_its_own_and_on_the_page() -> None:
    """Eighty lines at most, nothing of ours imported, and the same equations in all."""
    page = (DOCS / "rolling.md").read_text()
    assert len({equations(script) for script in SCRIPTS.values()}) == 1
    for name, script in SCRIPTS.items():
        assert f"](rolling/{name}.py)" in page
        assert len(script.splitlines()) <= 80
        assert not re.search(r"^\s*(import|from) (robotball|validation)", script, re.M)


def test_the_truth_of_the_scripts_is_that_of_the_scene() -> None:
    """With another momentum, or another turning of the frame, it is not."""
    theory = integrate(load_scene("fig12"), np.linspace(0, 10, 501))
    ours = equations(SCRIPTS["drake_rolls"])

    def error(equations: str) -> float:
        names: dict[str, Any] = {"np": np, "solve_ivp": solve_ivp}
        exec(equations, names)
        off = np.linalg.norm(names["truth"] - theory.contact_point, axis=1)
        return float(off.max() / theory.path_scale)

    assert error(ours) < 1e-9  # 6e-12
    assert error(ours.replace("5 * (h", "4.99 * (h")) > 1e-4
    assert error(ours.replace("0, 2.0])", "0, 1.99])")) > 1e-4
