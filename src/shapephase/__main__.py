"""`python -m shapephase`."""

from .cli.main import main

main()
