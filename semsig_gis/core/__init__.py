"""Words that every step shares: errors, geometry, grid, taxonomy, signatures, R-trees."""
