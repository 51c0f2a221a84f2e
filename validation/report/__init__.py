"""Self-contained HTML pages with texts, tables, plots and 3-D views."""

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from robotball.files import contents

from ..output import together
from .chart import Line, chart, legend

_HERE = Path(__file__).parent
VERDICTS = ("verdict bad", "verdict good")  # CSS classes of paragraphs
_HINT = "Point at the plot, or use the arrow keys, for values."
_NUMBER = set("0123456789.e+- ")
_MANY = 9  # columns; a table with more has small letters on paper


def page(title: str, body: Iterable[str], head: str = "") -> str:
    """Return a self-contained HTML page."""
    style, script = ((_HERE / f"page.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    content = "\n".join(body)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<link rel="icon" href="data:,">\n<title>{text(title)}</title>\n{head}\n'
        f"<style>{style}</style>\n</head>\n<body>\n<main>\n{content}\n</main>\n"
        f"<script>{script}</script>\n"
        "</body>\n</html>\n"
    )


def text(words: object) -> str:
    """Escape words for HTML, without line breaks next to relation signs or units."""
    return escape(together(" ".join(str(words).split())))


def paragraph(words: str, kind: str = "") -> str:
    """Return a paragraph of plain text."""
    return f'<p class="{kind}">{text(words)}</p>' if kind else f"<p>{text(words)}</p>"


def picture(path: Path) -> str:
    """Return a figure with an embedded PNG and its file name."""
    name, image = text(path.stem), embedded(contents(path), "image/png")
    return f'<figure><img alt="{name}" src="{image}"><figcaption>{name}</figcaption></figure>'


def table(headings: Sequence[str], rows: Iterable[Sequence[object]], kind: str = "") -> str:
    """Return a table. It scrolls if it is wider than the page."""
    head = "".join(f'<th scope="col">{text(heading)}</th>' for heading in headings)
    body = "".join(f"<tr>{''.join(map(_data, row))}</tr>" for row in rows)
    kind += " many" if len(headings) > _MANY else ""
    return (
        f'<div class="wide"><table class="{kind}"><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _data(cell: object) -> str:
    """Return a cell; on paper, numbers are not wrapped."""
    words = text(cell)
    return f'<td class="number">{words}</td>' if set(words) <= _NUMBER else f"<td>{words}</td>"


def folded(summary: str, inside: str, short: bool = False) -> str:
    """Return a part that the reader can unfold; a short part is unfolded on paper."""
    kind = ' class="short"' if short else ""
    return f"<details{kind}><summary>{text(summary)}</summary>{inside}</details>"


def plain(values: Mapping[str, Any]) -> str:
    """Return names and values as a table."""
    return table(("name", "value"), values.items(), "words")


def plot(
    caption: str, lines: Sequence[Line], x_label: str, y_label: str, note: str = "", **options: Any
) -> str:
    """Return a plot with a legend and the values under the pointer.

    `options` are options of `chart`.
    """
    drawn = chart(lines, x_label, y_label, **options)
    keys = legend(lines, slips=bool(options.get("slips")))
    remark = paragraph(note, "faint") if note else ""
    return (
        f"<figure><figcaption>{text(caption)}</figcaption><div>{keys}</div>{drawn}"
        f'<div class="readout" aria-live="polite">{_HINT}</div>{remark}</figure>'
    )


def embedded(data: bytes, kind: str) -> str:
    """Return a data URL of a file."""
    return f"data:{kind};base64,{b64encode(data).decode('ascii')}"
