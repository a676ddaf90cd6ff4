"""GeoPackages and rasters with their styles, and QGIS projects."""
