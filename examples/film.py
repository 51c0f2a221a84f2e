"""Film MuJoCo with default settings beside the equations: python examples/film.py."""

from pathlib import Path

import numpy as np

import robotball as rb

theory = rb.integrate("fig12", 1.0)
naive = rb.simulate("fig12", theory.times, settings="naive")
Path("out").mkdir(exist_ok=True)
path = rb.film("out/fig12.mp4", [naive, theory], fps=15, size=(360, 640))
apart = np.linalg.norm(naive.contact_point[-1] - theory.contact_point[-1])
print(f"{path}: {apart:.2f} m apart in the end")
