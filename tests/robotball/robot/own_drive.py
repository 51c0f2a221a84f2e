"""A user-defined rate: a function and a drive."""

import math


def of_sine(t: float) -> float:
    return 2 + math.sin(6 * t)


class OwnDrive:
    """A user-defined drive: it inherits nothing and only has the members of a drive."""

    breakpoints = ()

    def rate(self, t: float) -> float:
        return of_sine(t)

    def acceleration(self, t: float) -> float:
        return 6 * math.cos(6 * t)

    def angle(self, t: float) -> float:
        return 2 * t + (1 - math.cos(6 * t)) / 6
