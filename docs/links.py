"""Checks the book as it was built: every link within it leads to a file, and to a place in it where it names one.

Usage: python3 docs/links.py BOOK
"""

import html.parser
import pathlib
import sys
import urllib.parse


class Page(html.parser.HTMLParser):
    """The links of a page, and the places in it that links can name."""

    def __init__(self, path):
        super().__init__()
        self.links, self.places = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("href", "src") and value:
                self.links.append(value)
            elif name in ("id", "name") and value:
                self.places.add(value)


def main(book):
    pages = {path.resolve(): Page(path) for path in book.rglob("*.html")}
    checked, broken = 0, []
    for path, page in pages.items():
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            checked += 1
            # mdBook writes the links of its page for what is not found from the root
            target = (path.parent / urllib.parse.unquote(parts.path).lstrip("/")).resolve() if parts.path else path
            if target.is_dir():
                target /= "index.html"
            if not target.exists():
                broken.append(f"{path.name}: {link}")
            elif parts.fragment and target in pages and urllib.parse.unquote(parts.fragment) not in pages[target].places:
                broken.append(f"{path.name}: {link}: no such place")
    print(f"{len(pages)} pages, {checked} links")
    if not pages:
        sys.exit(f"{book} holds no page")
    if broken:
        sys.exit("broken links:\n" + "\n".join(sorted(set(broken))))


main(pathlib.Path(sys.argv[1]))
