"""Extracts of OpenStreetMap, or its elements in tiles from Overpass servers."""

from semsig_gis.sources.osm import documents, overpass
from semsig_gis.sources.osm.file import read_layers
from semsig_gis.sources.registry import READERS, Source, fetch_by_tiles

FETCH = fetch_by_tiles(overpass.fetch_layers, documents.read_layers)
READERS.register(Source(read=read_layers, fetch=FETCH, merging=True), __name__)
