"""XML files of bodies, read once: bytes to a light tree of elements that know their lines.

What makes an XML parser dangerous ends here: size, encoding, document types and their entities, depth, count.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from xml.parsers import expat

from ...errors import InputFileNotFoundError, ModelFileError

_MOST_BYTES = 16 * 2**20
"""Size of a file [bytes]; the largest body of example-robot-data has a fifth of a MiB."""
_MOST_OF_MOTION = 256 * 2**20
"""The same of a file that holds a motion, too [bytes]."""
_MOTIONS = (".bvh", ".mvnx")
"""Endings of such files."""
_MOST_DEPTH = 100
"""Elements inside each other: a URDF nests a few, an MJCF as many as its longest chain of bodies."""
_MOST_ELEMENTS = 200_000
"""Elements of a file: a hundred for each of the 2000 links that are supported."""
_MOST_NAME = 256
"""Characters of a name, which appears whole in messages and tables."""
_MOST_QUOTED = 60
"""Characters of the file that a message quotes."""
_MOST_ATTRIBUTES = 1000
"""Attributes of one element; expat hands them over only when it has them all, so they are counted before it."""
_LONG_TAG = re.compile(rb"<[^<!?\s][^<]{5000,}")
"""A tag so long that its attributes are counted; 1000 of them take at least 5000 bytes."""
_DECLARED = re.compile(r"""<\?xml[^>]*?encoding\s*=\s*["']([^"']*)["']""")
"""The encoding that the first line says."""
_UTF_8 = re.compile("utf-?8", re.IGNORECASE)
_WITH_ASCII = re.compile("(us-)?ascii|iso-?8859-[0-9]+|latin-?[0-9]+|(windows-|cp)125[0-9]", re.IGNORECASE)
"""Encodings in which a file of ASCII letters alone is the same as in UTF-8."""
_ATTRIBUTE = re.compile(rb"=\s*[\"']")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@dataclass(eq=False, slots=True)
class Node:
    """An XML element: its tag, attributes, children, and the file and line where it begins."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[Node] = field(default_factory=list)

    def get(self, name: str, default: str | None = None) -> str | None:
        """An attribute."""
        return self.attributes.get(name, default)

    def all(self, tag: str) -> list[Node]:
        """The children of this tag."""
        return [child for child in self.children if child.tag == tag]

    def walk(self) -> Iterator[Node]:
        """This element and all below it."""
        waiting: list[Node] = [self]
        while waiting:
            node = waiting.pop()
            yield node
            waiting.extend(reversed(node.children))

    def fault(self, owner: str, message: str) -> ModelFileError:
        """The error for what is wrong with this element; `owner` is what people call it: "link 'tail'"."""
        return ModelFileError(f"{self.file}:{self.line}: {owner}: {message}")

    def no_misspelt_attributes(self, names: Sequence[str], owner: str) -> None:
        """Raise ModelFileError for an attribute whose name is nearly one of those that are read."""
        for name in self.attributes:
            near = _near(name, tuple(names))
            if near is not None:
                raise self.fault(owner, f"<{self.tag}> {name}= is not read; did you mean {near}=?")


def read_file(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a body's file, read once.

    Raises
    ------
    InputFileNotFoundError
        If there is no readable file at `path`.
    ModelFileError
        If it is too large.
    """
    where = Path(path)
    most = _MOST_OF_MOTION if where.suffix.lower() in _MOTIONS else _MOST_BYTES
    if "\0" in str(where):
        raise InputFileNotFoundError(f"{str(where)!r}: a path has no zero bytes")
    try:
        if not where.is_file():
            kind = "no regular file" if where.exists() else "there is no such file"
            kind = "is a folder, not a file" if where.is_dir() else kind
            raise InputFileNotFoundError(f"{where}: {kind}")
        with where.open("rb") as stream:
            # One byte more than allowed tells a file that is too large, however large it says it is.
            content = stream.read(most + 1)
    except InputFileNotFoundError:
        raise
    except OSError as error:
        raise InputFileNotFoundError(f"{quoted(str(where))}: cannot be read ({error.strerror})") from None
    if len(content) > most:
        raise ModelFileError(f"{where}: larger than {most >> 20} MiB, which no body's file is")
    return content


def xml_tree(content: bytes, where: str) -> Node:
    """The root element of an XML file; `where` names the file in messages.

    Raises
    ------
    ModelFileError
        If it is no UTF-8, no well-formed XML, has a document type, or is too deep or too long.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ModelFileError(
            f"{where}:{line}: not UTF-8 text, byte {error.start} cannot be read; save the file as UTF-8"
        ) from None
    declared = _DECLARED.match(text)
    if declared and not (_UTF_8.fullmatch(declared[1]) or (content.isascii() and _WITH_ASCII.fullmatch(declared[1]))):
        raise ModelFileError(
            f"{where}:1: it says that it is {declared[1]:.40}, and it is UTF-8; correct its first line"
        )
    zero = content.find(b"\0")
    if zero >= 0:
        line = content.count(b"\n", 0, zero) + 1
        raise ModelFileError(f"{where}:{line}: not UTF-8 text, a zero byte at {zero}; save the file as UTF-8")
    for piece in _LONG_TAG.finditer(content):
        if len(_ATTRIBUTE.findall(piece.group())) > _MOST_ATTRIBUTES:
            line = content.count(b"\n", 0, piece.start()) + 1
            tag = quoted(piece.group()[1:70].decode(errors="replace").split()[0])
            raise ModelFileError(
                f"{where}:{line}: <{tag}>: more than {_MOST_ATTRIBUTES} attributes, as in no body's file"
            )
    builder = _Builder(where)
    try:
        # The whole buffer at once: in pieces a long token costs the square of its length.
        builder.parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise ModelFileError(
            f"{where}:{error.lineno}: not well-formed XML: {reason}: line {error.lineno}, column {error.offset + 1}"
        ) from None
    return builder.root


class _Builder:
    """What expat calls, element by element."""

    root: Node

    def __init__(self, where: str) -> None:
        self.where = where
        # UTF-8 whatever the declaration says, and namespaces as part of a tag: "http://...}tag}prefix".
        self.parser = expat.ParserCreate("utf-8", "}")
        self.parser.namespace_prefixes = True
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.open: list[Node] = []
        self.count = 0

    def _doctype(self, *_: object) -> None:
        raise ModelFileError(
            f"{self.where}:{self.parser.CurrentLineNumber}: a document type (DTD) is not allowed; remove the <!DOCTYPE>"
        )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        named = tag.rsplit("}", 2)
        if len(named) == 3:
            address, name, prefix = named
            # xacro goes by the prefix alone: files bind it to several addresses, old and new.
            tag = f"xacro:{name}" if prefix == "xacro" else f"{address}}}{name}"
        node = Node(tag, attributes, self.where, self.parser.CurrentLineNumber)
        self.count += 1
        if len(self.open) >= _MOST_DEPTH:
            raise node.fault(f"<{quoted(tag)}>", f"elements are nested more than {_MOST_DEPTH} deep, as in no body")
        if self.count > _MOST_ELEMENTS:
            raise node.fault(f"<{quoted(tag)}>", f"more than {_MOST_ELEMENTS} elements, as in no body's file")
        if self.open:
            self.open[-1].children.append(node)
        else:
            self.root = node
        self.open.append(node)

    def _end(self, _: str) -> None:
        self.open.pop()


def quoted(text: str | None) -> str:
    """A text for a message, shortened."""
    text = text or ""
    return text if len(text) <= _MOST_QUOTED else text[:_MOST_QUOTED] + "..."


def name_of(node: Node, name: str = "name") -> str:
    """A name attribute of an element: printable, no longer than 256 characters. Raises ModelFileError."""
    value = node.get(name)
    if not value or value.isspace():
        raise node.fault(f"<{node.tag}>", f"has no {name}; give it one")
    if len(value) > _MOST_NAME:
        raise node.fault(
            f"<{node.tag}> {quoted(value)!r}", f"a name of {len(value)} characters; up to {_MOST_NAME} are allowed"
        )
    if not value.isprintable():
        raise node.fault(f"<{node.tag}> {value!r}", "a name with characters that cannot be printed; rename it")
    return value


def child_of(node: Node, tag: str, owner: str) -> Node | None:
    """The only child of this tag, or None. Raises ModelFileError if there are several."""
    found = node.all(tag)
    if len(found) > 1:
        raise found[1].fault(owner, f"{len(found)} <{tag}> elements, at most one is allowed; remove the others")
    return found[0] if found else None


def needed_child(node: Node, tag: str, owner: str) -> Node:
    """The only child of this tag. Raises ModelFileError."""
    found = child_of(node, tag, owner)
    if found is None:
        raise node.fault(owner, f"<{node.tag}> has no <{tag}>; add it")
    return found


def known_attributes(node: Node, names: Sequence[str], owner: str) -> None:
    """Raise ModelFileError for an attribute that would be ignored: a misspelt number is a wrong number."""
    for name in node.attributes:
        if name not in names:
            raise node.fault(
                owner, f"<{node.tag}> has no attribute {quoted(name)!r}; valid are {', '.join(names) or 'none'}"
            )


def no_misspelt_children(node: Node, tags: Sequence[str], owner: str) -> None:
    """Raise ModelFileError for a child whose tag is nearly one of those that are read."""
    for child in node.children:
        near = _near(child.tag, tuple(tags))
        if near is not None:
            raise child.fault(owner, f"<{child.tag}> is not read; did you mean <{near}>?")


@lru_cache(maxsize=1024)
def _near(name: str, known: tuple[str, ...]) -> str | None:
    """Which of the known names a misspelt one was meant to be; None for one of them, or one far from all."""
    if name in known or len(name) > _MOST_QUOTED:
        return None
    near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.75)
    return near[0] if near else None


def number(node: Node, name: str, owner: str, default: str | None = None, most: float = 1e6) -> float:
    """One number of an attribute, its size below `most`. Raises ModelFileError."""
    return numbers(node, name, 1, owner, node.get(name, default), most)[0]


def vector(node: Node, name: str, owner: str, count: int = 3, most: float = 1e6) -> list[float]:
    """Numbers of an attribute, each below `most` in size. Raises ModelFileError."""
    return numbers(node, name, count, owner, node.get(name), most)


def numbers(node: Node, name: str, count: int, owner: str, text: str | None, most: float) -> list[float]:
    """`count` numbers in the text of an attribute. Raises ModelFileError."""
    needed = "a finite number is needed" if count == 1 else f"{count} finite numbers are needed, with blanks between"
    if text is None:
        raise node.fault(owner, f"<{node.tag}> has no {name}; {needed}")
    # One word too many shows that there are too many, however long the rest is.
    words = text.split(maxsplit=count)
    values = [float(word) for word in words if _NUMBER.fullmatch(word)]
    if len(words) != count or len(values) != count or not all(map(math.isfinite, values)):
        raise node.fault(owner, f"<{node.tag}> {name}={quoted(text)!r}: {needed}")
    if any(abs(value) >= most for value in values):
        raise node.fault(owner, f"<{node.tag}> {name}={quoted(text)!r}: too large, less than {most:g} is needed")
    return values
