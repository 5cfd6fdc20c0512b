"""Training of the network that outlines obstacles."""
