"""Properties of single images: noise, texture, edges and connected components."""
