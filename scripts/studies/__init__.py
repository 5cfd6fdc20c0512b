"""Studies for docs/evaluation_tables.md and docs/blind_conditions.md."""
