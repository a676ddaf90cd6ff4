"""Requests that are cached, resumed and polite."""
