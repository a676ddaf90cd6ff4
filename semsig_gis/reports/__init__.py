"""Tables, plots and pages to read."""
