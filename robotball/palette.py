"""The colours of what is drawn; each engine has its own in its label.

From Okabe and Ito's set, which stays apart for colour-blind eyes and in grey.
"""

INK = "#22262B"  # text
ACCENT = "#D55E00"  # what the rest is held against
FAINT = "#B4B9BF"  # what stands behind


def rgb(colour: str) -> tuple[float, float, float]:
    """(red, green, blue), each 0 to 1, of "#rrggbb"."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red / 255, green / 255, blue / 255
