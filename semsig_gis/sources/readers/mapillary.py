"""Map features of Mapillary along the streets, from files or by its Graph API (version 4)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import SourceError
from semsig_gis.sources.area import fetch_tiles, tiles_of
from semsig_gis.sources.http.fetch import DEFAULT_HTTP, HttpError, fetch, host_of
from semsig_gis.sources.registry import READERS, Source, fetch_by_tiles
from semsig_gis.sources.rows import WGS84, LayerBuilder
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.sources.area import Area, Tile
    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.fetch import HttpSpec
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

FIELDS = ("id", "object_value", "object_type", "geometry", "first_seen_at", "last_seen_at")
MOST_FEATURES = 2000  # in an answer, which does not show whether there are more
TILE_DEG = 0.02  # the limit is 0.01 square degrees, but that is too large in a city
MOST_SPLITS = 6
TOO_MUCH = 500  # HTTP status for a box that is too large or takes too long
UNAUTHORIZED = frozenset({400, 401, 403})


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from JSON files of map features.

    The files are answers of the Graph API, or GeoJSON with the same properties. A layer filters
    features by their values; features with the same id count once. SourceError if a file is
    neither.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    files = str(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
    features: dict[str, dict[str, Any]] = {}
    for file in paths:
        features.update((str(item.get("id", "")), item) for item in load_features(file))
    layers = []
    for spec in specs:
        where = f"layer {spec.name!r} ({files})"
        builder = LayerBuilder(spec, FIELDS, filters=filters, where=where)
        for name, feature in features.items():
            try:
                longitude, latitude = feature["geometry"]["coordinates"][:2]
                position: Position | str = float(longitude), float(latitude)
            except (KeyError, TypeError, ValueError):
                position = f"map feature {feature.get('id')} has no position"
            builder.rows.add(feature, name, position)
        layers.append(builder.layer(WGS84, requested=crs))
    return tuple(layers)


def load_features(path: Path, *, where: str = "") -> list[dict[str, Any]]:
    """Read a JSON file of Mapillary map features as dictionaries; SourceError if it is not one."""
    try:
        content = parse_json(path.read_bytes())
        pages = content if isinstance(content, list) else [content]
        features = [
            _as_feature(item)
            for page in pages
            for item in (page["data"] if "data" in page else page.get("features", [page]))
        ]
        if content != [] and all("object_value" in item for item in features):
            return features
    except (AttributeError, KeyError, OSError, TypeError, ValueError):
        pass
    raise SourceError(
        f"{where or path} is not an answer of Mapillary about map features; download it again."
    )


def _as_feature(item: dict[str, Any]) -> dict[str, Any]:
    """Return a map feature with the names of the Graph API; older files have others."""
    feature = {**item, **(item.get("properties") or {})}
    older = (("object_value", "value"), ("id", "key"))
    return feature | {
        name: feature[old] for name, old in older if name not in feature and old in feature
    }


def fetch_layers(
    specs: Sequence[LayerSpec],
    *,
    endpoints: Sequence[str],
    area: Area,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Fetch the map features of layers in an area, and some around it, as files for `read_layers`.

    The ``server_where`` of a layer lists the requested values, such as ``"regulatory--*"``. The
    service has no pages: if an answer is full, or a box is too large, its quarters are requested.
    Answers are cached, so that a later run continues an interrupted one. SourceError if the service
    refuses the token or fails.
    """
    host, url = host_of(endpoints[0]), f"{endpoints[0].rstrip('/')}/map_features"
    values = sorted({v for layer in specs for v in (layer.server_where or "").split(",") if v})
    common: dict[str, str | float] = {"fields": ",".join(FIELDS), "limit": MOST_FEATURES}
    if values:
        common["object_values"] = ",".join(values)
    # A box that is too large fails again, so only the smallest boxes get all attempts.
    short_spec = dataclasses.replace(spec, attempts=min(spec.attempts, 2))

    def fetch_tile(tile: Tile) -> Path | None:
        last = tile.splits == MOST_SPLITS
        try:
            path = fetch(
                url,
                params={**common, "bbox": ",".join(f"{side:.7f}" for side in tile.bounds)},
                cache=cache,
                spec=spec if last else short_spec,
                accept=("application/json", "text/javascript"),
                check=lambda file: load_features(file, where=f"the answer of {host}"),
            ).path
            full = len(load_features(path)) >= MOST_FEATURES
        except HttpError as error:
            if error.status in UNAUTHORIZED:
                raise HttpError(
                    f"{error}".rstrip(".") + "; check whether the access token is still valid.",
                    error.status,
                ) from error
            if error.status != TOO_MUCH or last:
                raise
            return None
        if full and last:
            raise SourceError(
                f"{host} sends no more than {MOST_FEATURES:,} features of even the smallest box."
            )
        return None if full else path

    tiles = tiles_of(area, TILE_DEG, remedy="give a smaller one")
    return fetch_tiles(tiles, area, fetch_tile, progress)


FETCH = fetch_by_tiles(fetch_layers, read_layers)
READERS.register(Source(read=read_layers, fetch=FETCH, merging=True), __name__)
