"""Motions that the search for a plan starts from."""
