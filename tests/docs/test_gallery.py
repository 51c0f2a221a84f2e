"""docs/gallery.md shows every picture of the docs with a valid command."""

import pytest

from bench.gallery import PICTURES, gallery_page, is_script
from tests.imports import PROJECT
from validation.cli import parse

DOCS = PROJECT / "docs"


def test_the_gallery_is_generated_from_gallery_toml() -> None:
    """With `make gallery`."""
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery_page()


def test_the_gallery_has_every_picture_of_the_docs_once() -> None:
    """Each has a caption."""
    shown = [row["shown"] for row in PICTURES]
    assert sorted(shown) == sorted(path.name for path in DOCS.glob("*.png"))
    assert all(row["words"].endswith(".") for row in PICTURES)


COMMANDS = dict.fromkeys(row["command"] for row in PICTURES)


@pytest.mark.parametrize("command", [name for name in COMMANDS if not is_script(name)])
def test_the_command_under_a_picture_is_valid(command: str) -> None:
    """It is a script, or it parses."""
    if command.endswith(".py"):
        assert (PROJECT / command).is_file()
    else:
        parse(command.split())


def test_the_pictures_are_below_0_4_MB() -> None:
    """Measured at most 0.24 MB; with all colours three times as large."""
    assert max(path.stat().st_size for path in DOCS.glob("*.png")) < 400_000
