"""Two settings of a physics engine side by side: errors, cost, and a picture of the paths.

python examples/side_by_side.py [SCENE] [PRESET…]
"""

import sys
from pathlib import Path

import robotball as rb


def main(name: str = "fig12", *presets: str) -> None:
    """Compare one scene at some presets, and draw the motions over the equations' motion."""
    scene = rb.load_scene(name)
    theory = rb.integrate(scene)
    agreements = [
        rb.compare(scene, settings=preset, theory=theory)
        for preset in presets or ("naive", "balanced")
    ]
    for each in agreements:
        print(f"{each.settings.name:10} path error {each.path_error or float('nan'):.1e}", end="  ")
        print(f"{each.realtime_factor or float('inf'):6.0f} x real time  {each.verdict}")
    figure = rb.plot(theory, *(each.motion for each in agreements))
    path = Path("out", f"{scene.name}-side-by-side.png")
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path)
    print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
