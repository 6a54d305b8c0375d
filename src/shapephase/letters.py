"""Texts of user input for messages: printable, short, in one line."""

from __future__ import annotations

from typing import Any

_LONGEST_GIVEN = 80  # characters of a value in a message
_PLAIN = (str, bytes, bool, int, float, complex, list, tuple, dict, set, type(None))  # shown by value, others by class


def printable(name: str) -> str:
    """Return a text with characters that are not printable, or change the direction of writing, escaped."""
    if name.isprintable():
        return name
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in name)


def shortened(name: str, longest: int) -> str:
    """Return a text of at most so many characters, without its middle where it is longer."""
    if len(name) <= longest:
        return name
    half = (longest - 1) // 2
    return f"{name[: longest - 1 - half]}…{name[len(name) - half :]}"


def value_text(value: Any) -> str:
    """Describe a wrong argument in one line: a plain value itself, any other object by its class."""
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    if isinstance(value, _PLAIN) or type(value).__module__ == "numpy":
        return shortened(" ".join(repr(value).split()), _LONGEST_GIVEN)
    kind = type(value).__name__
    return f"{article(kind)} {kind}"


def article(name: str) -> str:
    """Return the article before a name."""
    return "an" if name[:1].lower() in "aeiou" else "a"
