"""Kinds of sources, one a module. To add one, add its module (see `sources.registry`)."""
