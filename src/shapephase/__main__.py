"""`python -m shapephase`."""

from .cli import main

main()
