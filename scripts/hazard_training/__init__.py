"""Training of the network that judges the ground."""
