"""A link of a URDF file is a body, the same as MuJoCo's, or is refused in a line."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.files.foreign_bodies import solid_of_urdf
from tests.robotball.files.scene_texts import PENDULUM, URDF, Load


def test_a_link_is_mujocos_body_of_the_same_file(tmp_path: Path) -> None:
    """Compiled, MuJoCo fuses what a fixed joint holds. Measured 5e-17 of 0.007 kg m²: rounding."""
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    ours, model = solid_of_urdf(path, "arm"), mujoco.MjModel.from_xml_string(URDF)
    theirs = model.body("arm")
    axes = Rotation.from_quat(theirs.iquat, scalar_first=True).as_matrix()
    assert ours.mass == pytest.approx(1.3, rel=1e-15)
    np.testing.assert_allclose(ours.centre, theirs.ipos, atol=1e-16)
    np.testing.assert_allclose(ours.inertia, axes @ np.diag(theirs.inertia) @ axes.T, atol=2e-16)


def test_any_body_is_taken_from_a_file(load: Load, tmp_path: Path) -> None:
    """Laid at its origin and attitude: a quarter turn about x takes y to z."""
    (tmp_path / "arm.urdf").write_text(URDF)
    arm = solid_of_urdf(tmp_path / "arm.urdf", "arm")
    half = repr(np.sqrt(0.5).item())
    laid = f"origin = [0, 0, 0.05], attitude = [{half}, {half}, 0, 0] }}\n"
    hung = load(rest=PENDULUM + 'urdf = { file = "arm.urdf", link = "arm", ' + laid)
    x, y, z = arm.centre
    centre = hung.ball.pendulums[0].centre
    np.testing.assert_allclose(centre, [x, -z, y + 0.05], atol=1e-16)
    moments = np.linalg.eigvalsh(hung.ball.pendulums[0].inertia)
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(arm.inertia), rtol=1e-13)


REFUSED = {
    "no link is called 'arm'; there are base, leg": URDF.replace('"arm"', '"leg"'),
    "link 'arm' carries 'bob', which moves on it; take each as a body of its own":
        URDF.replace('"fixed"', '"continuous"'),
    "XML parse error": "<robot>",
    "no URDF: its root is <mujoco>, not <robot>": "<mujoco/>",
    "bad format in attribute 'value'": URDF.replace('"0.8"', '"heavy"'),
    "value takes finite numbers, not 'nan'": URDF.replace('"0.8"', '"nan"'),
    "xyz takes finite numbers, not '-inf ": URDF.replace('xyz="0.01', 'xyz="-inf'),
    "link 'arm''s inertial has no mass: 0 kg": URDF.replace('"0.8"', '"0"'),
    "URDF body has multiple parents": URDF.replace('<child link="bob"/>', '<child link="arm"/>'),
    "URDF joint parent or child missing":
        URDF.replace('<child link="bob"/>', '<child link="bab"/>'),
}  # fmt: skip


@pytest.mark.parametrize(("words", "text"), REFUSED.items(), ids=REFUSED)
def test_a_urdf_file_that_cannot_be_used_is_refused(tmp_path: Path, words: str, text: str) -> None:
    """In a line that names the file."""
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(rb.InputError, match=r"arm\.urdf: ") as caught:
        solid_of_urdf(path, "arm")
    assert words in str(caught.value)
