"""Sweep the friction of the plane, and find what a ball needs: python examples/sweep.py."""

import robotball as rb

needed = rb.integrate("fig12", 2.0).loads.sliding_friction.max()
sweep = rb.sweep("fig12", "sliding_friction", [0.8, 1.0, 1.2, 1.4], 2.0, settings="balanced")
print(sweep)
print(f"least friction that agrees: {sweep['value'][sweep['agrees']].min()}, needed {needed:.3f}")
