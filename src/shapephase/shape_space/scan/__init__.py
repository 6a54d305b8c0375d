"""Scans of functions of time, before a body follows them: panels, kinks, jumps, and checks of rates."""
