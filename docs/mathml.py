"""The equations of the pages: LaTeX between dollars becomes MathML, which browsers draw alone.

GitHub draws the same LaTeX itself. mkdocs.yml names this module as an extension of Python-Markdown.
"""

from re import Match
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor


class _Equation(InlineProcessor):
    """An equation in a line, `$…$`, or in one of its own, `$$…$$`."""

    def handleMatch(self, m: Match[str], data: str) -> tuple[Element | str, int, int]:  # type: ignore[override]
        display = "block" if m[1] == "$$" else "inline"
        return self.md.htmlStash.store(convert(m[2], display=display)), m.start(0), m.end(0)


class Equations(Extension):
    """Equations as MathML; after code spans, before backslashes are read as escapes."""

    def extendMarkdown(self, md: Markdown) -> None:
        md.inlinePatterns.register(_Equation(r"(\$\$?)([^$]+)\1", md), "equation", 185)


def makeExtension() -> Extension:
    """Return the extension; Python-Markdown calls it."""
    return Equations()
