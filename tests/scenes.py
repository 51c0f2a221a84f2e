"""The scenes on which bounds are as tight as their measured values; test_catalog has the rest."""

FOUR = ("classical_regular", "fig12", "fig13", "fig14")
