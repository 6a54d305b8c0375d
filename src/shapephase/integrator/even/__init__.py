"""Loops sampled at even times."""
