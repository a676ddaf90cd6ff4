"""Vector files with columns of OpenStreetMap's tags."""

from semsig_gis.sources.osm.features import read_layers
from semsig_gis.sources.registry import READERS, Source

READERS.register(Source(read=read_layers, merging=True), __name__)
