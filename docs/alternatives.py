"""What pictures and commands of the pages get when they are read: alternatives, and a prompt."""

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
    """Have every page transformed."""
    app.connect("doctree-read", lambda _, page: _prompt(page))
    app.add_post_transform(Alternatives)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _prompt(page: nodes.document) -> None:
    """Show cells of shell commands as a reader types them."""
    for block in page.findall(nodes.literal_block):
        text = block.astext()
        if text.startswith(SHELL):
            lines = text.removeprefix(SHELL).splitlines()
            typed = "\n".join(f"$ {line}" for line in lines)
            shown = nodes.literal_block(typed, typed)
            shown["language"] = "console"
            block.replace_self(shown)


class Alternatives(SphinxPostTransform):
    """Give each picture without an alternative the description that its drawing carries.

    Pictures of notebooks without one are called by the section that they are in.
    """

    default_priority = 300  # after the outputs of notebooks have been chosen

    def run(self, **_: Any) -> None:  # noqa: ANN401
        """Go through the pictures of a page."""
        for image in self.document.findall(nodes.image):
            if not image.get("alt"):
                image["alt"] = self._described(image)

    def _described(self, image: nodes.image) -> str:
        path = Path(self.app.srcdir, image["uri"])
        if path.suffix == ".svg" and path.is_file():
            found = DESCRIPTION.search(path.read_text(encoding="utf-8"))
            if found:
                return unescape(found[1])
        parent = image.parent
        while not isinstance(parent, nodes.section):
            parent = parent.parent
        return f"Figure: {parent[0].astext()}"
