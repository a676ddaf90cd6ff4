"""Interactive maps as HTML pages."""
