"""Contributions of one collocation node to a plan's program."""
