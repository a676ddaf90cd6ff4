"""How detectors fail: models, tables, fits."""
