"""The experiments of the paper and its published figures."""

from semsig_gis.evaluation.paper import published

__all__ = ["published"]
