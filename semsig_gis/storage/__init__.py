"""Atomic files and folders, resumable runs, GeoParquet, rasters, TOML and rows of text."""
