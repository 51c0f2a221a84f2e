"""What stands around a film's pictures: title, names, time, and the error with a moving cursor."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from robotball import palette
from robotball.film.canvas import Pixels
from robotball.rotations import Array

FONTS = Path(matplotlib.get_data_path(), "fonts", "ttf")
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
PAPER = "#FFFFFF"
LINES = 30  # of text in the picture's height
HEADER, FOOTER = 2.7, 6.0  # lines
LEAST = 1e-17  # m: what is less is drawn there
FINE = 3  # times as many pixels, in which the curve is drawn


@dataclass(frozen=True)
class Name:
    """A name over a pane, or of an arrow: text, colour, and how far from the left, 0 to 1."""

    text: str
    colour: str
    at: float = 0.5


class Sheet:
    """Everything but the pictures, drawn once, and what changes in it, a frame at a time.

    size: (height, width) in pixels; panes: how many pictures stand side by side; times (m,) s and
    apart (m,) m: the error's curve. pane: the (height, width) of a picture.
    """

    def __init__(
        self,
        size: tuple[int, int],
        panes: int,
        title: str,
        names: Sequence[Name],
        arrows: Sequence[Name],
        note: str,
        times: Array,
        apart: Array,
    ) -> None:
        height, width = size
        self._line = height / LINES
        self._end = float(times[-1])
        self.top = round(HEADER * self._line)
        self.bottom = height - round(FOOTER * self._line)
        self.pane = (self.bottom - self.top, width // panes)
        self._edges = [i * width // panes for i in range(1, panes)]
        image = Image.new("RGB", (width, height), PAPER)
        pen = ImageDraw.Draw(image)
        self._bold = ImageFont.truetype(str(FONTS / "DejaVuSans-Bold.ttf"), 0.72 * self._line)
        self._plain = ImageFont.truetype(str(FONTS / "DejaVuSans.ttf"), 0.66 * self._line)
        line, edge = self._line, 0.6 * self._line
        pen.text((edge, 0.75 * line), " ".join(title.split()), palette.INK, self._bold, "lm")
        for name in names:
            at = (name.at * width, 1.95 * line)
            pen.text(at, name.text, name.colour, self._bold, "mm")
        lengths = [self._bold.getlength(name.text) + line for name in arrows]
        begin = (width - sum(lengths) + line) / 2
        for name, length in zip(arrows, lengths, strict=True):
            pen.text((begin, 1.95 * line), name.text, name.colour, self._bold, "lm")
            begin += length
        # The curve has room for its numbers on the left, and for the value on the right.
        self._box = (5.6 * line, self.bottom + 1.8 * line, width - 8.6 * line, height - 1.6 * line)
        left, _, right, low = self._box
        pen.text(
            (edge, self.bottom + 0.8 * line), "contact points apart", palette.INK, self._plain, "lm"
        )
        pen.text((width - edge, self.bottom + 0.8 * line), note, palette.INK, self._plain, "rm")
        self._scale(apart)
        for value in (self._least, self._most):
            y = float(self._height(np.array([value]))[0])
            pen.line((left, y, right, y), palette.FAINT, 1)
            pen.text((left - 0.3 * line, y), metres(value), palette.INK, self._plain, "rm")
        for x, t in ((left, 0.0), (right, self._end)):
            pen.text((x, low + 0.75 * line), f"{t:g} s", palette.INK, self._plain, "mm")
        self._curve(image, times, apart)
        self._still = np.asarray(image)

    def frame(self, pictures: Pixels, t: float, apart: float) -> Pixels:
        """The whole frame (height, width, 3) at t [s], with the pictures in it."""
        whole = self._still.copy()
        whole[self.top : self.bottom] = pictures
        for edge in self._edges:
            whole[self.top : self.bottom, edge - 1 : edge + 1] = 0xFF
        width = whole.shape[1]
        line, (left, high, right, low) = self._line, self._box
        self._put(whole, f"t = {t:.2f} s", width - 0.6 * line, 0.75 * line)
        x = left + (right - left) * min(t / self._end, 1.0)
        half = max(1, round(line / 20))
        column = slice(round(x) - half, round(x) + half)
        whole[round(high - 0.3 * line) : round(low + 0.3 * line), column] = 0x22
        self._put(whole, metres(apart), width - 0.6 * line, (high + low) / 2)
        return whole

    def _put(self, whole: Pixels, text: str, right: float, middle: float) -> None:
        line = self._line
        x, y = int(right - 8 * line), int(middle - 0.7 * line)
        patch = Image.fromarray(whole[y : y + int(1.4 * line), x : round(right)])
        at = (patch.width - 1, middle - y)
        ImageDraw.Draw(patch).text(at, text, palette.INK, self._bold, "rm")
        whole[y : y + patch.height, x : x + patch.width] = np.asarray(patch)

    def _scale(self, apart: Array) -> None:
        """Decades from the least to the most, or from 0 where they are few."""
        positive = apart[apart > LEAST]
        self._log = len(positive) > 0 and positive.max() > 100 * np.percentile(positive, 10)
        self._least, self._most = 0.0, float(apart.max()) or 1.0
        if self._log:
            self._least = 10.0 ** np.floor(np.log10(np.percentile(positive, 10)))
            self._most = 10.0 ** np.ceil(np.log10(positive.max()))

    def _height(self, apart: Array) -> Array:
        _, high, _, low = self._box
        if self._log:
            ends = np.log([self._least, self._most])
            part = (np.log(np.maximum(apart, LEAST)) - ends[0]) / (ends[1] - ends[0])
        else:
            part = apart / self._most
        return low - np.clip(part, -0.08, 1.0) * (low - high)

    def _curve(self, image: Image.Image, times: Array, apart: Array) -> None:
        left, high, right, low = self._box
        margin = self._line / 4
        corner = (int(left - margin), int(high - margin))
        area = image.crop((*corner, int(right + margin), int(low + margin)))
        large = area.resize((area.width * FINE, area.height * FINE), Image.Resampling.NEAREST)
        x = left + (right - left) * times / self._end
        points = (np.column_stack([x, self._height(apart)]) - corner) * FINE
        pen = ImageDraw.Draw(large)
        pen.line(
            list(map(tuple, points.tolist())), palette.INK, max(3, round(self._line / 4)), "curve"
        )
        image.paste(large.resize(area.size, Image.Resampling.BOX), corner)


def metres(length: float) -> str:
    """A length [m] for reading: 0.123 m, 4.2 × 10⁻¹² m, 10⁻⁹ m."""
    if length == 0 or length >= 1e-3:
        return f"{length:.3g} m" if length < 1000 else f"{length:.0f} m"
    digits, exponent = f"{length:.1e}".split("e")
    power = f"10{str(int(exponent)).translate(SUPERSCRIPTS)} m"
    return power if digits == "1.0" else f"{digits} × {power}"
