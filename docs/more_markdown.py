"""Extensions for the site: equations as MathML, and definition lists and types in docstrings.

mkdocs.yml names this module as an extension of Python-Markdown and of Griffe, which reads the
docstrings. Browsers draw MathML themselves, and GitHub draws the same LaTeX.
"""

import re
from dataclasses import fields
from typing import Any
from xml.etree.ElementTree import Element

import griffe
from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from markdown.postprocessors import Postprocessor
from markdown.preprocessors import Preprocessor


class _Equation(InlineProcessor):
    """LaTeX within a line, `$…$`, or as a paragraph, `$$…$$`."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[Element | str, int, int]:  # type: ignore[override]
        html = convert(m[2], display="block" if m[1] == "$$" else "inline")
        html = html.replace("<mover>", '<mover accent="true">')  # full-size dots
        if m[1] == "$$":
            html = f'<div class="equation">{html}</div>'
        return self.md.htmlStash.store(html), m.start(0), m.end(0)


class _Fields(Preprocessor):
    """Turn docstring lines `name  meaning`, two spaces or more apart, into definitions."""

    def run(self, lines: list[str]) -> list[str]:
        text = re.sub(r"(?m)^(\w[\w, ]*?) {2,}(?=\S)", r"\n\1\n:   ", "\n".join(lines))
        return text.split("\n")


class _Options(Postprocessor):
    """Mark options in code within a line, so that site.css keeps them on one line."""

    def run(self, text: str) -> str:
        option = r"(?<![\w<-])(--[\w-]+)(?=[^<>]*</code>)"
        return re.sub(option, r'<span class="option">\1</span>', text)


class _MoreMarkdown(Extension):
    def extendMarkdown(self, md: Markdown) -> None:
        # After code (spans have priority 190, fences 25) and before backslash escapes.
        md.inlinePatterns.register(_Equation(r"(\$\$?)([^$]+)\1", md), "equation", 185)
        md.preprocessors.register(_Fields(md), "fields", 15)
        # Before code blocks are put back in (30).
        md.postprocessors.register(_Options(md), "options", 40)


def makeExtension() -> Extension:
    """Return the extension; Python-Markdown calls it."""
    return _MoreMarkdown()


class Types(griffe.Extension):
    """Show types as docstrings have them, and signatures without private names.

    Griffe adds brackets to a tuple such as `(n, 3), m`. Values replace private names.
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
            for item in section.value if isinstance(section.value, list) else ():
                kind = getattr(item, "annotation", None)
                if isinstance(kind, griffe.ExprTuple) and str(kind) not in obj.docstring.value:
                    kind.implicit = True


def _public(expression: Any, user: griffe.Object) -> Any:
    """Return an expression without private names and without msgspec's bounds."""
    if isinstance(expression, griffe.ExprName) and re.match("_[a-zA-Z]", expression.name):
        value = user.module.members.get(expression.name)
        if isinstance(value, griffe.Attribute):
            return _public(value.value, user)
    if isinstance(expression, griffe.ExprSubscript) and expression.canonical_name == "Annotated":
        return _public(expression.slice.elements[0], user)  # type: ignore[union-attr]
    if isinstance(expression, griffe.Expr):
        for field in fields(expression):
            if field.name != "parent":
                setattr(expression, field.name, _public(getattr(expression, field.name), user))
    if isinstance(expression, list):
        return [_public(item, user) for item in expression]
    return expression
