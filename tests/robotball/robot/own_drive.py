"""A rate of the user's own, as a function and as a drive."""

import math


def of_sine(t: float) -> float:
    return 2 + math.sin(6 * t)


class OwnDrive:
    """A drive of the user's own: nothing of the library's, but the members of one."""

    breakpoints = ()

    def rate(self, t: float) -> float:
        return of_sine(t)

    def acceleration(self, t: float) -> float:
        return 6 * math.cos(6 * t)

    def angle(self, t: float) -> float:
        return 2 * t + (1 - math.cos(6 * t)) / 6
