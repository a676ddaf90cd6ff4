"""The files of noise models: JSON, or TOML written by hand."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.errors import InputError
from semsig_gis.noise import noise_from_dict
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from semsig_gis.noise import Noise

__all__ = ["open_noise", "save_noise"]


def open_noise(path: str | Path) -> Noise:
    """Read a noise model from a file.

    Parameters
    ----------
    path : str or Path
        A JSON file, or a TOML file with the suffix ``.toml``.

    Returns
    -------
    NoiseSpec or NoiseMixture
        The model.

    Raises
    ------
    InputError
        If the file cannot be read or does not hold a noise model.

    Examples
    --------
    >>> open_noise("nowhere.toml")
    Traceback (most recent call last):
    ...
    semsig_gis.errors.InputError: noise file nowhere.toml cannot be read (No such file or
    directory); give a JSON or TOML file.
    """
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
    """Write a noise model to a file.

    Parameters
    ----------
    noise : NoiseSpec or NoiseMixture
        The model.
    path : str or Path
        File to write, TOML with the suffix ``.toml`` and JSON else; it appears whole, by rename.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.noise import NoiseSpec
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_noise(NoiseSpec(clutter=2.0), f"{folder}/noise.json")
    ...     open_noise(f"{folder}/noise.json").clutter
    2.0
    """
    values = noise.to_dict()
    if Path(path).suffix.lower() == ".toml":
        text = _toml(values)
    else:
        text = json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8")


def _toml(values: Mapping[str, Any], *above: str) -> str:
    """Return values as TOML: numbers and texts first, then a section for each table."""
    tables = {name: part for name, part in values.items() if isinstance(part, Mapping)}
    lines = [
        f"{_key(name)} = {_inline(part)}\n" for name, part in values.items() if name not in tables
    ]
    for name, part in tables.items():
        path = (*above, _key(name))
        plain = not any(isinstance(one, Mapping) for one in part.values())
        lines += [f"\n[{'.'.join(path)}]\n"] if plain and part else []
        lines.append(_toml(part, *path))
    return "".join(lines)


def _inline(value: Any) -> str:  # noqa: ANN401 - any value of JSON
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(n)} = {_inline(one)}' for n, one in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    return _text(value) if isinstance(value, str) else json.dumps(value, allow_nan=False)


def _key(name: str) -> str:
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else _text(name)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
