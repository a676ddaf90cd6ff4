"""Files for other programs: GeoPackage, GeoParquet, GeoJSON, CSV, tiles, rasters, KML and STAC."""
