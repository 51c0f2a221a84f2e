"""The colours of everything drawn: one for each engine, the same in plots and in the video.

From Okabe and Ito's set, which stays apart for colour-blind eyes and in grey.
"""

ENGINE = "#0072B2"  # blue: MuJoCo's motion
THEORY = "#D55E00"  # vermillion: the motion by the equations
INK = "#22262B"  # text


def rgb(colour: str) -> tuple[float, float, float]:
    """(red, green, blue), each 0 to 1, of "#rrggbb"."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red / 255, green / 255, blue / 255
