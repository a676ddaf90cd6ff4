"""Files that appear whole, runs that resume, tables that carry their specs."""
