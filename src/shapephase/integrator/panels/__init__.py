"""Deformations sampled on panels between their breaks."""
