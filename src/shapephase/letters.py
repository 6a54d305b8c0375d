"""Names of users as they are shown: letter by letter, whatever they are."""

from __future__ import annotations


def printable(name: str) -> str:
    """A text with what cannot be printed, or changes the direction of writing, written out."""
    if name.isprintable():
        return name
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in name)


def shortened(name: str, longest: int) -> str:
    """A text of at most so many letters, without its middle where it is longer."""
    if len(name) <= longest:
        return name
    half = (longest - 1) // 2
    return f"{name[: longest - 1 - half]}…{name[len(name) - half :]}"
