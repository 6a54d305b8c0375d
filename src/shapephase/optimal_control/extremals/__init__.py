"""Curves that can be optimal: their equations, how far a path is from them, and how far along they stay optimal."""
