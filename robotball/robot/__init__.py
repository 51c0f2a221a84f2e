"""What rolls: bodies, shapes, drives, motors, controllers, and the formulas of their mechanics."""
