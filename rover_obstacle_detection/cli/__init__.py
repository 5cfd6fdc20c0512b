"""The command line; it parses arguments and leaves the work to `offline` and `node`."""
