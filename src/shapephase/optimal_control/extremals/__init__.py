"""Extremals: their equations, the distance of a path from them, and the time up to which they are optimal."""
