"""Compare two settings of MuJoCo with the equations: python examples/compare.py."""

from pathlib import Path

import robotball as rb

theory = rb.integrate("fig12", 2.0)
naive = rb.compare("fig12", 2.0, settings="naive", theory=theory)
balanced = rb.compare("fig12", 2.0, settings="balanced", theory=theory)
for each in (naive, balanced):
    print(f"{each.settings.name}: path error {each.path_error:.1e}")
Path("out").mkdir(exist_ok=True)
rb.plot(theory, naive.motion, balanced.motion).savefig("out/compare.png")
