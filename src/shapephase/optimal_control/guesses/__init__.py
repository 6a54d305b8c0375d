"""Motions from which the search for a plan starts."""
