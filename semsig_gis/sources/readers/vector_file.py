"""Vector files and tables with coordinates."""

from semsig_gis.sources.registry import READERS, Source
from semsig_gis.sources.vector.file import read_layers

READERS.register(Source(read=read_layers), __name__)
