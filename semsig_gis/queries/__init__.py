"""Queries of known places and from files, and what spoils them."""
