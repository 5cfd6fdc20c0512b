"""Rendered planetary scenes with ground truth, written as labelled bags (extra ``sim``)."""
