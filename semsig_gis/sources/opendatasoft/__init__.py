"""Portals of Opendatasoft."""
