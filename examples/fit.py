"""Fit the gain of a motor to a log with noise: python examples/fit.py."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import robotball as rb

motion, random = rb.integrate("pendulum_robot", 1.0), np.random.default_rng(1)
noisy = motion.contact_point + random.normal(0.0, 1e-3, motion.contact_point.shape)
Path("out").mkdir(exist_ok=True)
replace(motion, contact_point=noisy).save("out/run.csv")
found = rb.fit("pendulum_robot", "out/run.csv", ["frame.kv"]).found[0]
print(f"{found.name} = {found.value:.4f} ± {found.deviation:.1g} {found.unit}, in the scene 0.4")
