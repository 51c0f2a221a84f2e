"""The site that `make docs` builds: links, names, search, and pages on a phone, dark and on paper.

It is built once, from a copy of its sources, by the command of the Makefile.
"""

import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from html import unescape
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from tests.browser import Browser, needs_browser, opened
from tests.imports import PROJECT, PUBLIC

REFERENCE = "".join(path.read_text() for path in (PROJECT / "docs" / "reference").glob("*.md"))


def test_a_public_name_is_documented_once() -> None:
    """It is a name of its package, has a docstring of its own, and is on one page of reference/."""
    entries = re.findall(r"^::: (\S+)$", REFERENCE, re.MULTILINE)
    assert len(entries) == len(set(entries))
    for home, name in PUBLIC:
        value = getattr(import_module(home), name)
        assert getattr(import_module(home.partition(".")[0]), name) is value
        assert f"{home}.{name}" in entries, name
        written = (value.__doc__ or "").strip() if callable(value) else "a value"
        assert written, name
        assert not written.startswith(f"{name}("), name  # made by dataclass


def build(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the Makefile's command on the mkdocs.yml and docs/ of a folder."""
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("zensical")
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(PROJECT / "mkdocs.yml", folder)
    shutil.copytree(PROJECT / "docs", folder / "docs")
    done = build(folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "out" / "site"


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """The site over HTTP, on this machine alone."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=site)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.mark.slow
def test_a_dead_link_ends_the_build(site: Path, tmp_path: Path) -> None:
    """The project's pages have none; a page with one is refused, and so is an unknown heading."""
    assert (site / "reference" / "running.html").exists()
    (tmp_path / "docs").mkdir()
    (tmp_path / "mkdocs.yml").write_text("site_name: small\n")
    for text, fails in ("[here](index.md)", 0), ("[there](no.md)", 1), ("[a](index.md#b)", 1):
        (tmp_path / "docs" / "index.md").write_text(f"# Small\n\n{text}\n")
        assert build(tmp_path).returncode == fails, text


@pytest.mark.slow
def test_equations_are_mathml_and_each_page_leads_on(site: Path) -> None:
    """The method's are all drawn, none left as LaTeX; the pages of the menu are one row."""
    written = (PROJECT / "docs" / "method.md").read_text()
    page = (site / "method.html").read_text()
    assert page.count('display="block"') == written.count("$$") / 2 >= 8
    assert page.count("<math ") == len(re.findall(r"\$\$?[^$]+\$\$?", written))
    assert "$" not in re.sub("(?s)<script.*?</script>", "", page)
    menu = re.findall(r"([\w/]+)\.md", (PROJECT / "mkdocs.yml").read_text())
    for last, each, then in zip(["", *menu], menu, [*menu[1:], ""], strict=False):
        head = (site / f"{each}.html").read_text().partition("</head>")[0]
        for way, page in ("prev", last), ("next", then):
            leads = re.findall(f'rel="{way}" href=".*?([\\w-]+).html"', head)
            assert leads == [page.rpartition("/")[2]] if page else leads == [], (each, way)


@pytest.mark.slow
def test_sections_of_docstrings_are_tables(site: Path) -> None:
    """Each parameter is a row, with its type as it is written: shape, unit and frame."""
    page = (site / "reference" / "motion.html").read_text()
    rows = re.findall(r'(?s)<tr class="doc-section-item.*?</tr>', page)
    cells = [[words_of(each) for each in re.findall("(?s)<td>(.*?)</td>", row)] for row in rows]
    assert ["contact_force", "(n, 3), N, world"] in [row[:2] for row in cells]


@pytest.mark.slow
def test_a_signature_has_no_private_name(site: Path) -> None:
    """Nor the bounds that msgspec checks; the types of `integrate` and Settings are written out."""
    pages = [path.read_text() for path in (site / "reference").glob("*.html")]
    found = re.findall('(?s)<div class="doc-signature.*?</div>', "".join(pages))
    signatures = [words_of(each) for each in found]
    assert len(signatures) > 100
    assert [each for each in signatures if re.search(r"\b_[a-z]|Annotated", each, re.I)] == []
    assert any('equations: Literal["reduced", "multibody"]' in each for each in signatures)
    assert any("timestep: float | None = None, integrator: str | None" in s for s in signatures)


def words_of(page: str) -> str:
    """The text of a part of a page, in one line."""
    return " ".join(unescape(re.sub("<[^>]*>", "", page)).split())


@pytest.mark.slow
def test_an_unknown_address_has_a_page(site: Path) -> None:
    """It leads to the first page, and asks for its files from any folder."""
    page = (site / "404.html").read_text()
    assert "It was moved, or the address has a misprint" in page
    leads = re.findall(r'(?:href|src)="([^"#]*)"', page)
    assert "/index.html" in leads
    assert [each for each in leads if not each.startswith("/")] == []
    assert all((site / each.partition("?")[0][1:]).exists() for each in leads)


# What reaches beyond the width, and by nothing that scrolls; on paper nothing scrolls.
BEYOND = """[...document.querySelectorAll("article *")].filter(each => {
  if (each.getBoundingClientRect().right <= document.documentElement.clientWidth + 1) return false
  for (let e = each; e && !matchMedia("print").matches; e = e.parentElement)
    if (["auto", "scroll"].includes(getComputedStyle(e).overflowX)) return false
  return true
}).map(each => each.outerHTML.slice(0, 80)).slice(0, 3)"""
# Each page's search would read the index again, at a third of the time; it has its own test.
UNSEARCHED = "window.Worker = class { postMessage() {} addEventListener() {} terminate() {} }"
DARK = "getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0] < 50"


def longest(site: Path, number: int) -> list[Path]:
    """Return so many pages of each folder, the longest."""
    pages = sorted(site.rglob("*.html"), key=lambda page: -page.stat().st_size)
    beside = {page: [each for each in pages if each.parent == page.parent] for page in pages}
    return [page for page in pages if beside[page].index(page) < number]


@needs_browser
@pytest.mark.slow
@pytest.mark.parametrize(
    "number", [pytest.param(2, id="few"), pytest.param(99, id="all", marks=pytest.mark.study)]
)
def test_no_page_overflows_complains_or_asks_outside(
    number: int, site: Path, address: str, tmp_path: Path
) -> None:
    """On a phone's 360 pixels in the dark, and between the margins of A4."""
    with opened("<p style='width: 2000px'>", tmp_path, 360, 200, webgl=False) as browser:
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=UNSEARCHED)
        for page in longest(site, number):
            browser.size(360, 200, dark=True)
            browser.visit(f"{address}{page.relative_to(site)}")
            assert browser.run(DARK), page.name
            assert browser.run(BEYOND) == [], page.name
            browser.size(718, 200, media="print")
            assert browser.run(BEYOND) == [], page.name
        asked = [each for each in browser.requests[1:] if not each.startswith("data:")]
        assert [each for each in asked if not each.startswith(address)] == []
        assert browser.console == []
        browser.run("document.querySelector('article').innerHTML = '<p style=\"width: 2000px\">'")
        assert browser.run(BEYOND) != []


PALETTE = "Object.keys(localStorage).filter(each => each.endsWith('palette'))"


@needs_browser
@pytest.mark.slow
def test_a_palette_is_stored_when_it_is_clicked(site: Path, address: str, tmp_path: Path) -> None:
    """A visit stores none; so a page follows the system until its reader chooses."""
    with opened("", tmp_path, 400, 200, webgl=False) as browser:
        for dark in True, False:
            browser.size(400, 200, dark=dark)
            browser.visit(f"{address}index.html")
            assert browser.run(DARK) is dark
            assert browser.run(PALETTE) == []
        browser.run("document.querySelector('label[for=__palette_1]').click()")
        assert browser.run(DARK)
        assert len(browser.run(PALETTE)) == 1
        browser.visit(f"{address}method.html")
        assert browser.run(DARK)


# The search is in a closed tree of its own; it is opened, so that the list of results can be read.
OPEN = "const attach = Element.prototype.attachShadow; \
Element.prototype.attachShadow = function () { return attach.call(this, { mode: 'open' }) }"
TREE = "[...document.querySelectorAll('*')].find(each => each.shadowRoot)?.shadowRoot"
SEARCH = f"{TREE}?.querySelector('input')"
FOCUSED = f"{TREE}?.activeElement?.matches('input')"
LISTED = f"({TREE}.querySelector('ol')?.innerText ?? '').toLowerCase()"


@needs_browser
@pytest.mark.slow
@pytest.mark.parametrize("by", ["http", "file"])
def test_the_search_finds(by: str, site: Path, address: str, tmp_path: Path) -> None:
    """Words that are typed, over HTTP and in a page opened as a file; but none that no page has."""
    # The window is small, as each letter is drawn.
    with opened("", tmp_path, 400, 200, webgl=False) as browser:
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=OPEN)
        browser.visit(f"{address}index.html" if by == "http" else f"{site.as_uri()}/index.html")
        browser.run("document.querySelector('.md-search__button').click()")
        assert waited(browser, FOCUSED)
        for words in "friction cone", "adaptive", "torsional", "xyzzy":
            browser.run(f"{SEARCH}.select()")
            for letter in words:
                browser.call("Input.dispatchKeyEvent", type="keyDown", text=letter)
            found = [f"{LISTED}.includes('{word}')" for word in words.split()]
            expected = " && ".join(found) if words != "xyzzy" else f"{LISTED} === ''"
            assert waited(browser, f"{SEARCH}.value === '{words}' && {expected}"), words
        assert browser.console == []


def waited(browser: Browser, script: str) -> bool:
    """Whether a script becomes true; it has as long as the busiest machine asks for."""
    end = time.monotonic() + 60
    while not (value := browser.run(script)) and time.monotonic() < end:
        time.sleep(0.1)
    return bool(value)
