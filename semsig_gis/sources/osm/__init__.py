"""OpenStreetMap files and Overpass."""
