"""Line charts as SVG, with data for the script that shows values under the pointer.

Text and axes have the colour of the page, so a chart also works on a dark page. Lines differ in
their dashes, names and colours.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import groupby

import numpy as np

from robotball.files import embedded_json
from robotball.rotations import Array
from robotball.view.tracks import BAND, SHADE, SLIPS, LineStyle, slip_parts

from ..plots import LEAST, in_view

_POINTS = 400  # points of a line; a screen shows no more
_WIDTH, _HEIGHT = 560, 330  # px, size of the picture
_LEFT, _RIGHT, _TOP, _BOTTOM = 66, 16, 38, 46  # px around the axes; the y label is at the top
_DIGITS = 5  # digits of a value under the pointer
_CROSS = "m-5-5 10 10m0-10-10 10"
_NO_POINTS = np.empty(0)


@dataclass(frozen=True)
class Line:
    """A line of a chart.

    Attributes
    ----------
    look : Look
        The style and name.
    x, y : (n,)
        The points.
    times : (n,), s, or None
        The times of the points, if x is not the time.
    width : float
        The width of the line.
    broken : bool
        Whether the run failed. The line then ends with a cross.
    """

    look: LineStyle
    x: Array
    y: Array
    times: Array | None = None
    width: float = 1.8
    broken: bool = False


def chart(
    lines: Sequence[Line],
    x_label: str,
    y_label: str,
    *,
    log: bool = False,
    reach: float = math.inf,
    frame: Array | None = None,
    slips: Sequence[tuple[float, float]] = (),
) -> str:
    """Return an <svg> with axes, ticks and lines.

    The attribute `data-lines` has the values that the page's script shows under the pointer.

    Parameters
    ----------
    lines : sequence of Line
        The lines, the reference first.
    x_label, y_label : str
        The labels of the axes.
    log : bool
        Whether the y axis is logarithmic.
    reach : float
        How far the y axis extends beyond the first line to show the other lines.
    frame : (2, 2), optional
        The ends of axes with equal scales; a dot marks the start.
    slips : sequence of (float, float), s
        The intervals of slip, shaded if x is the time. Otherwise they are a band on the first line.
    """
    thin = [_fewer_points(line) for line in lines]
    xs, ys = [line.x for line in thin], [line.y for line in thin]
    (x0, x1), (y0, y1) = _range(xs, math.inf), _log_range(ys) if log else _range(ys, reach)
    width, height = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    if frame is not None:
        (x0, x1), (y0, y1) = frame.tolist()
        height = round(width * (y1 - y0) / (x1 - x0))

    def px(x: Array) -> Array:
        return _LEFT + (np.asarray(x) - x0) / (x1 - x0) * width

    def py(y: Array) -> Array:
        shown = np.log10(np.maximum(y, 10.0**y0)) if log else np.asarray(y)
        return _TOP + (y1 - shown) / (y1 - y0) * height

    inside = f'x="{_LEFT}" y="{_TOP}" width="{width}" height="{height}"'
    parts = [f'<rect {inside} fill="none" stroke="currentColor" stroke-opacity=".45"/>']
    right, low = _LEFT + width, _TOP + height
    for tick in ticks(x0, x1):
        x = float(px(np.array(tick)))
        parts += [_grid(x, _TOP, x, low), _svg_text(x, low + 18, f"{tick:g}")]
    powers = (n for n in ticks(y0, y1) if n % 1 == 0)
    for tick in powers if log else ticks(y0, y1, 5):
        y = float(py(np.array(10.0**tick if log else tick)))
        words = f"1e{tick:.0f}" if log else f"{tick:g}"
        parts += [_grid(_LEFT, y, right, y), _svg_text(_LEFT - 6, y + 4, words, "end")]
    parts.append(_svg_text(_LEFT + width / 2, low + 40, x_label))
    parts.append(_svg_text(2, 18, y_label, "start"))
    data = [_data(line, px(line.x), py(line.y)) for line in thin]
    # The nested <svg> clips the lines.
    parts.append(f'<svg {inside} viewBox="{_LEFT} {_TOP} {width} {height}">')
    if (times := thin[0].times) is None:
        parts += [_shade(px(np.array(interval)).tolist(), height) for interval in slips]
    else:
        for part in slip_parts(slips, times):
            band = Line(SLIPS, thin[0].x[part], thin[0].y[part], width=BAND)
            parts.append(_polyline(band, px(band.x), py(band.y)))
    parts += [_polyline(line, px(line.x), py(line.y)) for line in thin]
    if frame is not None:
        parts.append(f'<circle cx="{px(xs[0])[0]:.1f}" cy="{py(ys[0])[0]:.1f}" r="4.5"/>')
    names = ", ".join(line.look.label for line in lines)
    return (
        f'<svg class="chart" role="img" viewBox="0 0 {_WIDTH} {_TOP + height + _BOTTOM}" '
        f'aria-label="{escape(f"{y_label} over {x_label}: {names}", quote=True)}" '
        f'data-lines="{escape(embedded_json(data), quote=True)}" '
        f'style="max-width:{_WIDTH}px">{"".join(parts)}</svg></svg>'
    )


def legend(lines: Sequence[Line], *, slips: bool = False) -> str:
    """Return a legend as HTML, with an entry for slip if there is any."""
    shown = [*lines, Line(SLIPS, _NO_POINTS, _NO_POINTS, width=BAND)] if slips else lines
    return "".join(
        '<span class="key"><svg width="34" height="10" aria-hidden="true">'
        f'<line x1="1" y1="5" x2="33" y2="5" {_stroke(line)}/></svg> '
        f"{escape(line.look.label)}</span> "
        for line in shown
    )


def ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Return at most `most` multiples of 1, 2 or 5 times 10^n between low and high."""
    raw = (high - low) / most
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(n * power for n in (1, 2, 5, 10) if n * power >= raw * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(n * step, 12) + 0.0 for n in range(first, last + 1)]


def _fewer_points(line: Line) -> Line:
    count = len(line.x)
    if count <= _POINTS:
        return line
    kept = np.linspace(0, count - 1, _POINTS).round().astype(int)
    kept = np.union1d(kept, np.flatnonzero(~np.isfinite(line.y)))
    times = None if line.times is None else line.times[kept]
    return replace(line, x=line.x[kept], y=line.y[kept], times=times)


def _range(values: Sequence[Array], reach: float) -> tuple[float, float]:
    """Return distinct ends of an axis, slightly beyond the finite values."""
    low, high = in_view(values[0], np.concatenate(values), reach)
    least = 1e-6 * max(abs(low), abs(high)) or 1.0
    if high - low < least:
        low, high = low - least, high + least
    margin = 0.03 * (high - low)
    return low - margin, high + margin


def _log_range(values: Sequence[Array]) -> tuple[float, float]:
    """Return the exponents of the decades that contain the values above rounding."""
    every = np.concatenate(values)
    positive = every[np.isfinite(every) & (every > LEAST)]
    if not len(positive):
        return math.log10(LEAST), math.log10(LEAST) + 2
    return math.floor(np.log10(positive.min())), math.ceil(np.log10(positive.max()) + 1e-9)


def _shade(x: Sequence[float], height: float) -> str:
    inside = f'x="{x[0]:.1f}" y="{_TOP}" width="{x[1] - x[0]:.1f}" height="{height}"'
    return f'<rect {inside} fill="{SLIPS.colour}" fill-opacity="{SHADE}"/>'


def _grid(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="grid" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def _svg_text(x: float, y: float, words: str, anchor: str = "middle") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def _stroke(line: Line) -> str:
    dash = " ".join(f"{part * line.width:g}" for part in line.look.dash)
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'stroke="{line.look.colour}" stroke-width="{line.width}" fill="none"{dashed}'


def _polyline(line: Line, x: Array, y: Array) -> str:
    """Return a line, interrupted at values that are not finite; with a cross if it is broken."""
    runs = groupby(zip(x, y, strict=True), lambda place: math.isfinite(sum(place)))
    parts = [" ".join(f"{a:.1f},{b:.1f}" for a, b in run) for whole, run in runs if whole]
    style = f'{_stroke(line)} stroke-linejoin="round"'
    drawn = "".join(f'<polyline points="{points}" {style}/>' for points in parts)
    if line.broken and parts:
        at = f"M{parts[-1].split()[-1]}{_CROSS}"
        drawn += f'<path d="{at}" stroke="currentColor" stroke-width="3"/>'
    return drawn


def _data(line: Line, x: Array, y: Array) -> dict[str, object]:
    """Return the data of a line for the page's script: pixels and values."""
    return {
        "name": line.look.label,
        "colour": line.look.colour,
        "at": [*zip(_svg_numbers(x, ".1f"), _svg_numbers(y, ".1f"), strict=True)],
        "x": _svg_numbers(line.x),
        "y": _svg_numbers(line.y),
        "t": line.times if line.times is None else _svg_numbers(line.times),
    }


def _svg_numbers(values: Array, form: str = f".{_DIGITS}g") -> list[float | None]:
    return [float(f"{x:{form}}") if math.isfinite(x) else None for x in values.tolist()]
