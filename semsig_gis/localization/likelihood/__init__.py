"""Rank cells by likelihood: index, re-rank, refine, explain, learn."""
