"""What each cell sees: build, tile, save, open, update."""
