"""Parameters learned from labelled recordings (optional extra tune)."""
