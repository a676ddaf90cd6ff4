"""Speed of the package beside a peer measured in the same run: ``python -m benchmarks``."""
