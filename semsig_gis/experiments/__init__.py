"""Resumable runs of many evaluations."""
