"""The workbench: a local page to ask where a photo was taken, and its server."""
