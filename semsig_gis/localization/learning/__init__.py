"""Noise models learnt from samples, and changed for the age of a map."""
