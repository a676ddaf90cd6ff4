"""Experiments: many queries, methods and distortions, run in parts."""
