"""An HTML page as a browser parses it."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Elements of a page.

    Attributes
    ----------
    scripts : list of str
        Text of each script.
    found : set of str
        Tags and names of all attributes.
    """

    def __init__(self, page: str) -> None:
        super().__init__()
        self.scripts: list[str] = []
        self.found: set[str] = set()
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found |= {tag, *(name for name, _ in attrs)}
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self.cdata_elem == "script":
            self.scripts[-1] += data
