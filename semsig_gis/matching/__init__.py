"""Rank cells by distance."""
