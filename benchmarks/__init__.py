"""Speed of the package compared with peers in the same run: ``python -m benchmarks``."""
