"""Compare the motions from many starts: python examples/many_starts.py."""

from dataclasses import replace

import robotball as rb

scene = rb.load_scene("fig12")
momenta = [0.5 + 0.1 * i for i in range(10)]
starts = [replace(scene.start, momentum=f * scene.start.momentum) for f in momenta]
spread = rb.compare_many(scene, starts, 2.0, settings="balanced").summary("path_error")
print(f"{spread['runs']} runs, {spread['faulty']} with a fault, path error below 1e-8:", end=" ")
print(spread["worst"] < 1e-8)
