"""The catalogue ``town.toml`` and the list of errors that tests make in it."""

from __future__ import annotations

from pathlib import Path

DATA = Path(__file__).parent / "sources" / "data"
TOWN = (DATA / "town.toml").read_text(encoding="utf-8")
MISTAKES = (DATA / "mistakes.txt").read_text(encoding="utf-8").splitlines()[2:]


def mistake(row: str) -> tuple[str, str, list[str]]:
    """Return the text to replace, its replacement, and the words of a row of `MISTAKES`."""
    change, *words = row.replace(r"\n", "\n").split(" | ")
    old, sign, new = change.partition(" -> ")
    if not sign:
        old, _, line = change.partition(" + ")
        new = f"{old}\n{line}"
    if old.endswith("..."):
        old = TOWN[TOWN.index(old.removesuffix("...")) :]
    return old, new, words
