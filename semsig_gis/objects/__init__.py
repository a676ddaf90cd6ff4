"""Load raw layers into one checked table of street objects."""
