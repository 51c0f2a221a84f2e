"""Equations as MathML, and what docstrings say of names, for the pages of the site.

mkdocs.yml names this module as an extension of Python-Markdown, and of Griffe, which reads the
docstrings. Browsers draw MathML by themselves, and GitHub draws the same LaTeX.
"""

import re
from dataclasses import fields
from typing import Any
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
    """Write types as docstrings do, and signatures without private names.

    `(n, 3), m` is a tuple to Griffe, which adds brackets. A private name is replaced by its value.
    """

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        if isinstance(obj, griffe.Attribute):
            obj.annotation = _public(obj.annotation, obj)
        if isinstance(obj, griffe.Function):
            obj.returns = _public(obj.returns, obj)
            for parameter in obj.parameters:
                parameter.annotation = _public(parameter.annotation, obj)
                parameter.default = _public(parameter.default, obj)
        if obj.docstring is None:
            return
        for section in obj.docstring.parsed:
            for each in section.value if isinstance(section.value, list) else ():
                kind = getattr(each, "annotation", None)
                if isinstance(kind, griffe.ExprTuple) and str(kind) not in obj.docstring.value:
                    kind.implicit = True


def _public(written: Any, user: griffe.Object) -> Any:
    """Return an expression without private names, and without the bounds that msgspec checks."""
    if isinstance(written, griffe.ExprName) and re.match("_[a-zA-Z]", written.name):
        meant = user.module.members.get(written.name)
        if isinstance(meant, griffe.Attribute):
            return _public(meant.value, user)
    if isinstance(written, griffe.ExprSubscript) and written.canonical_name == "Annotated":
        return _public(written.slice.elements[0], user)  # type: ignore[union-attr]
    if isinstance(written, griffe.Expr):
        for each in fields(written):
            if each.name != "parent":
                setattr(written, each.name, _public(getattr(written, each.name), user))
    return [_public(each, user) for each in written] if isinstance(written, list) else written
