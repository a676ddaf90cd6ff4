"""Files of one format each."""
