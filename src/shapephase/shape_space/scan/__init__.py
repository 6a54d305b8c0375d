"""Functions of time looked at once, before any body is asked: panels, kinks, jumps, and whether rates fit."""
