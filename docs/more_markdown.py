"""Equations as MathML, and what docstrings say of names, for the pages of the site.

mkdocs.yml names this module as an extension of Python-Markdown, and of Griffe, which reads the
docstrings. Browsers draw MathML by themselves, and GitHub draws the same LaTeX.
"""

import re
from xml.etree.ElementTree import Element

import griffe
from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor


class _Equation(InlineProcessor):
    """LaTeX in a line, `$…$`, or in a paragraph of its own, `$$…$$`."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[Element | str, int, int]:  # type: ignore[override]
        found = convert(m[2], display="block" if m[1] == "$$" else "inline")
        found = found.replace("<mover>", '<mover accent="true">')  # else a dot is shrunk
        if m[1] == "$$":
            found = f'<div class="equation">{found}</div>'
        return self.md.htmlStash.store(found), m.start(0), m.end(0)


class _Fields(Preprocessor):
    """Docstrings' lines of a name, two spaces or more and its meaning: definitions."""

    def run(self, lines: list[str]) -> list[str]:
        text = re.sub(r"(?m)^(\w[\w, ]*?) {2,}(?=\S)", r"\n\1\n:   ", "\n".join(lines))
        return text.split("\n")


class _MoreMarkdown(Extension):
    def extendMarkdown(self, md: Markdown) -> None:
        # After code (spans at 190, fences at 25), and before backslashes are read as escapes.
        md.inlinePatterns.register(_Equation(r"(\$\$?)([^$]+)\1", md), "equation", 185)
        md.preprocessors.register(_Fields(md), "fields", 15)


def makeExtension() -> Extension:
    """Return the extension; Python-Markdown calls it."""
    return _MoreMarkdown()


class Types(griffe.Extension):
    """Write types as docstrings do: `(n, 3), m` is a tuple to Griffe, which adds brackets."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        if obj.docstring is None:
            return
        for section in obj.docstring.parsed:
            for each in section.value if isinstance(section.value, list) else ():
                kind = getattr(each, "annotation", None)
                if isinstance(kind, griffe.ExprTuple) and str(kind) not in obj.docstring.value:
                    kind.implicit = True
