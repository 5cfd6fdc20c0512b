"""What one image tells: grey levels, edges, noise, texture, connected parts."""
