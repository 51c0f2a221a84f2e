"""The ideal motion: the reduced and the multibody equations, integrated to round-off."""
