"""Scenes for tests with tight bounds; test_catalog has the others."""

FOUR = ("classical_regular", "fig12", "fig13", "fig14")
