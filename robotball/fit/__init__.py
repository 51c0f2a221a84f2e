"""Logs of real robots, and the parameters of a scene fitted to them."""
