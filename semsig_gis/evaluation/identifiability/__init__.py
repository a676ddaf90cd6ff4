"""How well each cell can be distinguished from all others, before any query."""
