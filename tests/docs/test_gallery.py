"""docs/gallery.md shows every picture of the docs, each with a command that there is."""

import pytest

from bench.gallery import PICTURES, gallery_page, is_script
from tests.imports import PROJECT
from validation.cli import parse

DOCS = PROJECT / "docs"


def test_the_page_is_the_table() -> None:
    """As `make gallery` writes it from gallery.toml."""
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery_page()


def test_every_picture_of_the_docs_is_in_the_gallery_once() -> None:
    """And none is there that the docs do not have; each has words for who does not see it."""
    shown = [row["shown"] for row in PICTURES]
    assert sorted(shown) == sorted(path.name for path in DOCS.glob("*.png"))
    assert all(row["words"].endswith(".") for row in PICTURES)


COMMANDS = dict.fromkeys(row["command"] for row in PICTURES)


@pytest.mark.parametrize("command", [each for each in COMMANDS if not is_script(each)])
def test_the_command_under_a_picture_is_one(command: str) -> None:
    """It is a script, or its words and options parse; a mistyped one would end the program."""
    if command.endswith(".py"):
        assert (PROJECT / command).is_file()
    else:
        parse(command.split())


def test_the_pictures_are_small() -> None:
    """Under 0.4 MB each, measured at most 0.24; with all their colours three times that."""
    assert max(path.stat().st_size for path in DOCS.glob("*.png")) < 400_000
