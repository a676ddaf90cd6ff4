"""JSON files of Overpass servers."""

from semsig_gis.sources.osm.documents import read_layers
from semsig_gis.sources.registry import READERS, Source

READERS.register(Source(read=read_layers, merging=True), __name__)
