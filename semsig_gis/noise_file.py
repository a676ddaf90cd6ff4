"""The files of noise models: JSON, or TOML written by hand."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.errors import InputError
from semsig_gis.noise import noise_from_dict
from semsig_gis.storage import whole_file
from semsig_gis.toml_text import toml_text

if TYPE_CHECKING:
    from semsig_gis.noise import Noise

__all__ = ["open_noise", "save_noise"]


def open_noise(path: str | Path) -> Noise:
    """Read a noise model from a JSON file, or a TOML file with the suffix ``.toml``."""
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
        values = tomllib.loads(text) if file.suffix.lower() == ".toml" else json.loads(text)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        msg = f"noise file {file} cannot be read ({reason}); give a JSON or TOML file."
        raise InputError(msg) from error
    return noise_from_dict(values)


def save_noise(noise: Noise, path: str | Path) -> None:
    """Write a noise model as TOML (suffix ``.toml``) or JSON; the file appears whole, by rename."""
    values = noise.to_dict()
    if Path(path).suffix.lower() == ".toml":
        text = toml_text(values)
    else:
        text = json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
