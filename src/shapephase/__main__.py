"""`python -m shapephase`."""

from .cli.start import run

run()
