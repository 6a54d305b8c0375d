"""Names of users, and what else they gave, as they are shown: letter by letter, whatever they are."""

from __future__ import annotations

from typing import Any

# Letters of a value that a message repeats.
_LONGEST_GIVEN = 80
# What is shown by its value; anything else by its kind.
_PLAIN = (str, bytes, bool, int, float, complex, list, tuple, dict, set, type(None))


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


def what_came(value: Any) -> str:
    """What came instead of what was wanted, in one line: a plain value itself, of anything else the kind."""
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    if isinstance(value, _PLAIN) or type(value).__module__ == "numpy":
        return shortened(" ".join(repr(value).split()), _LONGEST_GIVEN)
    kind = type(value).__name__
    return f"{article(kind)} {kind}"


def article(name: str) -> str:
    """The article that goes before a name."""
    return "an" if name[:1].lower() in "aeiou" else "a"
