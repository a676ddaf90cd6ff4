"""How views are spoiled: models, tables, fits."""
