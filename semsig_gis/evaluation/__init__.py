"""Answers to queries of known places: error, recall, calibration."""
