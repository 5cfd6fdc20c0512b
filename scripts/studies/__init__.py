"""Studies for docs/evaluation_tables.md."""
