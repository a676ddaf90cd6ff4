"""Raw layers become one clean table of street objects."""
