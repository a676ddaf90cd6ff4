"""Queries of known places -> error, recall, calibration."""
