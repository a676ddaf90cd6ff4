"""How well each cell can be told from all others, before any query."""
