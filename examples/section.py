"""Draw a Poincaré section of a chaotic ball: python examples/section.py."""

from pathlib import Path

from matplotlib.figure import Figure

import robotball as rb

section = rb.section("fig14", 1000)
figure = Figure()
axes = figure.add_subplot(xlabel="l [rad]", ylabel="L [kg m²/s]", title="fig14, g = 0")
axes.plot(section.l[0], section.L[0], ".", markersize=2)
Path("out").mkdir(exist_ok=True)
figure.savefig("out/section.png")
print(f"{section.found[0]} crossings, the first at {section.times[0, 0]:.4f} s")
