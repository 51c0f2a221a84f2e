"""Run the notebooks of this folder, store their outputs, and write their pages: `make tutorials`.

A notebook is the one source of its page. Its cells run in order, without Jupyter, in a folder of
their own. A cell is Python, commands below `%%sh`, or a file below `%%writefile NAME`. Its outputs
are what it prints, the value it ends with, and its pictures, with its first comment as their
description. A page shows commands and files without these lines: so the text above names a file.
The first code cell, which pages leave out and which does not run here, installs robotball in a
hosted notebook.

python docs/tutorials/notebooks.py [NAME…]
"""

import ast
import contextlib
import io
import json
import os
import shlex
import subprocess
import sys
import tempfile
import warnings
from base64 import b64decode, b64encode
from pathlib import Path
from typing import Any
from unittest.mock import patch

import matplotlib
from PIL import Image

from robotball import InputError
from validation.cli import main

FOLDER = Path(__file__).parent
NOTEBOOKS = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
Json = dict[str, Any]
_SHELL, _WRITE = "%%sh", "%%writefile "
_LANGUAGES = {".xml": "xml", ".toml": "toml", ".py": "python", ".yml": "yaml"}
# Where commands run: colours and the width of lines would be those of whoever runs them, and pytest
# cuts no line where a CI server is known by its variables.
_PLACE = {"COLUMNS": "88", "NO_COLOR": "1", "PY_COLORS": "0"} | dict.fromkeys(
    ("CI", "BUILD_NUMBER", "PYTEST_ADDOPTS"), ""
)
# In a hosted notebook: from a wheel in the notebook's folder, else from the package index.
INSTALL = """\
# Install robotball if it is missing.
from importlib.util import find_spec

if find_spec("robotball") is None:
    %pip install --quiet --find-links . robotball
"""
_COLOURS = 64  # of a stored picture: lines and letters need no more, and a third of the bytes


def read(name: str) -> Json:
    """Return a notebook of this folder, without its cell that installs robotball."""
    book: Json = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    book["cells"] = [cell for cell in book["cells"] if cell.get("id") != "install"]
    return book


def write(name: str, book: Json) -> None:
    """Write a notebook, with the cell that installs robotball below the title."""
    install = {"cell_type": "code", "execution_count": None, "id": "install", "metadata": {},
               "outputs": [], "source": INSTALL.rstrip().splitlines(keepends=True)}  # fmt: skip
    title, *cells = book["cells"]
    text = json.dumps({**book, "cells": [title, install, *cells]}, indent=1, ensure_ascii=False)
    (FOLDER / f"{name}.ipynb").write_text(f"{text}\n", encoding="utf-8")


def code_cells(book: Json) -> list[Json]:
    """Return the cells that run."""
    return [cell for cell in book["cells"] if cell["cell_type"] == "code"]


def run(book: Json, folder: Path) -> list[list[Json]]:
    """Run a notebook in an empty folder, and return each cell's outputs as notebooks store them.

    The folder gets the examples of the checkout where a notebook sees them from here. Raises
    whatever a cell raises.
    """
    matplotlib.use("agg")
    here = folder / "docs" / "tutorials"
    here.mkdir(parents=True)
    (folder / "examples").symlink_to(FOLDER.parents[1] / "examples")
    names: Json = {}
    with contextlib.chdir(here), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "FigureCanvasAgg")  # which has no window for plt.show()
        return [_outputs("".join(cell["source"]), names) for cell in code_cells(book)]


def _outputs(source: str, names: Json) -> list[Json]:
    """Run a cell with the names of those before it, and return its outputs."""
    from matplotlib import pyplot

    printed, shown = io.StringIO(), []
    if source.startswith(_WRITE):
        name, _, text = source.removeprefix(_WRITE).partition("\n")
        Path(name).write_text(f"{text}\n", encoding="utf-8")
        printed.write(f"Writing {name}\n")
    elif source.startswith(_SHELL):
        for line in source.splitlines()[1:]:
            printed.write(_command(line))
    else:
        *lines, last = ast.parse(source).body
        value = isinstance(last, ast.Expr)
        with contextlib.redirect_stdout(printed):
            exec(compile(ast.Module(lines if value else [*lines, last], []), "cell", "exec"), names)
            if value:
                shown = [eval(compile(ast.Expression(last.value), "cell", "eval"), names)]
    outputs = [_shown(each) for each in [*shown, *map(pyplot.figure, pyplot.get_fignums())]]
    pyplot.close("all")
    text = printed.getvalue()
    stream = {"name": "stdout", "output_type": "stream", "text": text.splitlines(keepends=True)}
    return ([stream] if text else []) + [each for each in outputs if each]


def _command(line: str) -> str:
    """Run robotball or another module's command, and return what it prints to standard output.

    A status of 1 is an answer: of `check`, that a model is wrong; of pytest, that a test failed.
    Raises InputError where a command cannot be run.
    """
    name, *arguments = shlex.split(line)
    with patch.dict(os.environ, _PLACE):
        if name == "robotball":
            status, printed, said = _robotball(arguments)
        else:
            words = [sys.executable, "-m", name, *arguments]
            done = subprocess.run(words, capture_output=True, text=True)
            status, printed, said = done.returncode, done.stdout, done.stderr
    if status > 1:
        raise InputError(f"{line}: status {status}: {said}")
    return printed


def _robotball(arguments: list[str]) -> tuple[int, str, str]:
    """Run the command here, as a process of its own would import everything again."""
    printed, said, status = io.StringIO(), io.StringIO(), 0
    streams = contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said)
    with warnings.catch_warnings(), streams[0], streams[1]:
        try:
            main(arguments)
        except SystemExit as leaving:
            status = int(leaving.code or 0)
    return status, printed.getvalue(), said.getvalue()


def _shown(value: Any) -> Json:
    """Return the output that displays a value: its picture if it has one, else its text."""
    if value is None:
        return {}
    png = io.BytesIO()
    if hasattr(value, "savefig"):
        value.savefig(png, format="png", dpi=100)
    elif hasattr(value, "_repr_png_"):  # an Image of IPython's, which has it in base 64
        png.write(b64decode(value._repr_png_()))
    if not png.tell():
        data = {"text/plain": repr(value).splitlines(keepends=True)}
        return {"data": data, "execution_count": None, "metadata": {},
                "output_type": "execute_result"}  # fmt: skip
    small = io.BytesIO()
    Image.open(png).convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE).save(
        small, format="png", optimize=True
    )
    data = {"image/png": b64encode(small.getvalue()).decode("ascii")}
    return {"data": data, "metadata": {}, "output_type": "display_data"}


def page(name: str, book: Json) -> dict[str, bytes]:
    """Return the files of a notebook's page: its Markdown, and its pictures, by their names."""
    files: dict[str, bytes] = {}
    parts: list[str] = []
    for cell in book["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(_shown_source(source))
        for output in cell["outputs"]:
            data = output.get("data", {"text/plain": output.get("text")})
            if "image/png" in data:
                picture = f"{name}-{len(files) + 1}.png"
                files[picture] = b64decode(data["image/png"])
                words = next(line for line in source.splitlines() if line.startswith("# "))
                parts.append(f"![{words.removeprefix('# ')}]({picture})")
            elif not source.startswith(_WRITE):
                parts.append(_fenced("text", "".join(data["text/plain"])))
    link = f"This page is the notebook [{name}.ipynb]({name}.ipynb); "
    parts.insert(1, f"{link}[how to run it](../install.md#notebooks).")
    parts.append(f"<!-- Written from {name}.ipynb by `make tutorials`. -->")
    files[f"{name}.md"] = ("\n\n".join(parts) + "\n").encode("utf-8")
    return files


def _shown_source(source: str) -> str:
    """Return a cell as its page shows it: Python, the lines of a shell, or a file."""
    first, _, rest = source.partition("\n")
    if first.startswith(_SHELL):
        return _fenced("sh", rest)
    if first.startswith(_WRITE):
        return _fenced(_LANGUAGES[Path(first).suffix], rest)
    return _fenced("python", source)


def _fenced(language: str, text: str) -> str:
    # A line ends without blanks, as of tables, which editors and `git diff` complain of.
    lines = "\n".join(line.rstrip() for line in text.rstrip("\n").splitlines())
    return f"```{language}\n{lines}\n```"


def store(name: str) -> None:
    """Run a notebook, store its outputs in it, and write its page."""
    book = read(name)
    with tempfile.TemporaryDirectory() as folder:
        computed = run(book, Path(folder))
    for i, (cell, outputs) in enumerate(zip(code_cells(book), computed, strict=True), 1):
        cell["execution_count"], cell["outputs"] = i, outputs
        for output in outputs:
            if "execution_count" in output:
                output["execution_count"] = i
    write(name, book)
    for old in FOLDER.glob(f"{name}-*.png"):
        old.unlink()
    for file, content in page(name, book).items():
        (FOLDER / file).write_bytes(content)


if __name__ == "__main__":
    for each in sys.argv[1:] or NOTEBOOKS:
        print(each, flush=True)
        store(each)
