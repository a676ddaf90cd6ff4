"""Simulated queries: true views and their distortions."""
