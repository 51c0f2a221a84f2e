"""How the ball must roll: the reduced and the multibody equations, integrated to round-off."""
