from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semsig_gis.commands import Option, Reporter, Result, command


@command("count-benches", title="Count benches", group="Look", order=50, returns=int)
@dataclass(frozen=True, kw_only=True)
class CountBenches:
    """Count the benches of Testville."""

    file: Annotated[Path, Option("Benches of Testville.", positional=True, reads=True)]

    def run(self, _reporter: Reporter) -> Result:
        return Result(values=lambda: len(self.file.read_text(encoding="utf-8").splitlines()))
