"""Studies beyond the figures of methods, for docs/evaluation.md."""
