"""Locate a view in a signature database."""
