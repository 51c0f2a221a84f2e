"""Write a scene for other simulators, as MJCF and URDF: python examples/export.py."""

import mujoco

import robotball as rb

files = rb.export_scene("fig12", "out/fig12", 2.0)
print(*(file.name for file in files))
model = mujoco.MjModel.from_xml_path("out/fig12/model.xml")
print(f"mass {model.body_mass.sum():.3f} kg, {model.njnt} joints")
