"""Noise models: how detectors and people fail, as parameters and as arrays."""
