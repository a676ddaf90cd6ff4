"""Parsed HTML pages for tests."""

from __future__ import annotations

from collections import defaultdict
from html.parser import HTMLParser

VOID = {"br", "img", "link", "meta"}
ADDRESSES = {"src", "srcset", "data", "poster"}
ON_A_NEW_LINE = {"p", "br", "tr", "table"}


class HtmlPage(HTMLParser):
    """Tags, text and loaded addresses of a page or a part of it; its elements must be nested."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.loaded: list[str] = []
        self.text = ""
        self.text_of: defaultdict[str, list[str]] = defaultdict(list)  # by element
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        assert not any(name.startswith("on") for name, _ in attrs)
        self.loaded += [
            value or ""
            for name, value in attrs
            if name in ADDRESSES or (tag == "link" and name == "href")
        ]
        if tag not in VOID:
            self.open.append(tag)
        if tag != "bdi":
            self.text += "\n" if tag in ON_A_NEW_LINE else " "

    def handle_endtag(self, tag: str) -> None:
        assert tag in VOID or self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open:
            self.text_of[self.open[-1]].append(data)
