"""The command line: argument parsing apart from the work."""
