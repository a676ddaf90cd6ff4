"""Results as layers: a table with a geometry, columns and styles."""
