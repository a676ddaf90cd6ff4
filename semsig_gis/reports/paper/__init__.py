"""The report that compares our figures with the paper's."""
