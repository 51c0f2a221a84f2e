"""Two balls as MJCF, to be posed and looked at: the second is a ghost over the first."""

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from robotball import palette
from robotball.files.looks_mjcf import add_materials, add_shapes
from robotball.looks import BLUR, PARTS, Shape
from robotball.rotations import Array

GHOST = 0.35  # opacity of all balls but the first


def build_stage(looks: Mapping[str, Sequence[Shape]], colours: Sequence[str]) -> mujoco.MjModel:
    """The floor, and a ball in each of the colours; lengths in radii.

    Its mocap bodies are those of the first ball in the order of `looks`, then of the next.
    """
    root = ElementTree.parse(PARTS / "floor.xml").getroot()
    assets, world = root.find("asset"), root.find("worldbody")
    assert assets is not None
    assert world is not None
    for number, colour in enumerate(colours):
        prefix, rgb = f"ball{number}_", " ".join(f"{part:g}" for part in palette.rgb(colour))
        opacity = GHOST if number else 1.0
        add_materials(assets, {"shell": rgb, "mark": rgb}, prefix, opacity)
        for name, shapes in looks.items():
            body = SubElement(world, "body", name=f"{prefix}{name}", mocap="true")
            seen = [shape for shape in shapes if shape.material != BLUR]
            add_shapes(assets, body, seen, prefix=prefix)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def pose(data: mujoco.MjData, stands: Sequence[Mapping[str, tuple[Array, Array]]]) -> None:
    """Places the balls, each as `Track.stands` says for one time."""
    bodies = [body for each in stands for body in each.values()]
    data.mocap_pos[:] = np.array([shift[0] for _, shift in bodies])
    turns = Rotation.from_matrix(np.array([turn[0] for turn, _ in bodies]))
    data.mocap_quat[:] = turns.as_quat(scalar_first=True)
