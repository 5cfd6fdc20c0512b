"""Self-contained HTML reports with plots and embedded pictures."""
