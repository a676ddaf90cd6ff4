"""The report of the paper's experiments, with our figures and the paper's."""
