"""Add text alternatives to the pictures of the pages, and a prompt to their shell commands."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DESCRIPTION = re.compile(r"<desc>(.*?)</desc>", re.DOTALL)
SHELL = "%%bash\n"


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transformations of every page."""
    app.connect("doctree-read", lambda _, page: _prompt(page))
    app.add_post_transform(Alternatives)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _prompt(page: nodes.document) -> None:
    """Show cells of shell commands with a prompt, as in a terminal."""
    for block in page.findall(nodes.literal_block):
        text = block.astext()
        if text.startswith(SHELL):
            lines = text.removeprefix(SHELL).splitlines()
            typed = "\n".join(f"$ {line}" for line in lines)
            shown = nodes.literal_block(typed, typed)
            shown["language"] = "console"
            block.replace_self(shown)


class Alternatives(SphinxPostTransform):
    """Give each picture without an alternative the description in its SVG file.

    The alternative of other pictures is the title of their section.
    """

    default_priority = 300  # after the outputs of notebooks have been chosen

    def run(self, **_: Any) -> None:  # noqa: ANN401
        """Set the missing alternatives of the pictures of a page."""
        for image in self.document.findall(nodes.image):
            if not image.get("alt"):
                image["alt"] = self._described(image)

    def _described(self, image: nodes.image) -> str:
        path = Path(self.app.srcdir, image["uri"])
        if path.suffix == ".svg" and path.is_file():
            match = DESCRIPTION.search(path.read_text(encoding="utf-8"))
            if match:
                return unescape(match[1])
        parent = image.parent
        while not isinstance(parent, nodes.section):
            parent = parent.parent
        return f"Figure: {parent[0].astext()}"
