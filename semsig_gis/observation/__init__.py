"""Observations of people and detectors, as views."""
