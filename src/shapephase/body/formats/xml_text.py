"""XML files of bodies, read once: bytes to a light tree of elements that know their lines."""

from __future__ import annotations

import codecs
import difflib
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from xml.parsers import expat

from ...arrays import FARTHEST
from ...errors import InputFileNotFoundError, ModelFileError
from ...files import no_such_file

_MOST_QUOTED = 60  # characters of the file in a message
_DECLARED = re.compile(rb"""<\?xml[^>]*?encoding\s*=\s*["']([\w.-]+)["']""")  # the encoding that the first line states
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@dataclass(eq=False, slots=True)
class Node:
    """An XML element: tag, attributes, children, the file and line where it begins, and its name in messages."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[Node] = field(default_factory=list)
    owner: str = ""

    def own(self, owner: str) -> None:
        """Name this element and all below it in messages, as "link 'tail'"."""
        for node in self.walk():
            node.owner = owner

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

    def fault(self, message: str, owner: str = "") -> ModelFileError:
        """The error for what is wrong with this element."""
        return ModelFileError(f"{self.file}:{self.line}: {owner or self.owner or f'<{quoted(self.tag)}>'}: {message}")

    def name(self, attribute: str = "name") -> str:
        """A name attribute, printable. Raises ModelFileError."""
        value = self.get(attribute)
        if not value or value.isspace():
            raise self.fault(f"has no {attribute}; give it one", f"<{self.tag}>")
        if not value.isprintable():
            what = f"<{self.tag}> {quoted(value)!r}"
            raise self.fault("a name with characters that cannot be printed; rename it", what)
        return value

    def child(self, tag: str) -> Node | None:
        """The only child of this tag, or None. Raises ModelFileError if there are several."""
        children = self.all(tag)
        if len(children) > 1:
            raise children[1].fault(f"{len(children)} <{tag}> elements, at most one is allowed; remove the others")
        return children[0] if children else None

    def needed_child(self, tag: str) -> Node:
        """The only child of this tag. Raises ModelFileError."""
        child = self.child(tag)
        if child is None:
            raise self.fault(f"<{self.tag}> has no <{tag}>; add it")
        return child

    def check_attributes(self, *names: str) -> None:
        """Raise ModelFileError for an attribute that would be ignored: a misspelt number is a wrong number."""
        for name in self.attributes:
            if name not in names and not name.startswith("xmlns:"):
                valid = ", ".join(names) or "none"
                raise self.fault(f"<{self.tag}> has no attribute {quoted(name)!r}; valid are {valid}")

    def check_children(self, tags: Sequence[str]) -> None:
        """Raise ModelFileError for a child whose tag is nearly one of those that are read."""
        for child in self.children:
            near = _near(child.tag, tuple(tags))
            if near is not None:
                raise child.fault(f"<{child.tag}> is not read; did you mean <{near}>?")

    def number(self, name: str, default: str | None = None, most: float = FARTHEST) -> float:
        """One number of an attribute, its size below `most`. Raises ModelFileError."""
        return self._numbers(name, 1, self.get(name, default), most)[0]

    def vector(self, name: str, count: int = 3) -> list[float]:
        """Numbers of an attribute, each below 1e6 in size. Raises ModelFileError."""
        return self._numbers(name, count, self.get(name), FARTHEST)

    def _numbers(self, name: str, count: int, text: str | None, most: float) -> list[float]:
        needed = (
            "a finite number is needed" if count == 1 else f"{count} finite numbers are needed, with blanks between"
        )
        if text is None:
            raise self.fault(f"<{self.tag}> has no {name}; {needed}")
        # One word too many shows that there are too many, however long the rest is.
        words = text.split(maxsplit=count)
        values = [float(word) for word in words if _NUMBER.fullmatch(word)]
        if len(words) != count or len(values) != count or not all(map(math.isfinite, values)):
            raise self.fault(f"<{self.tag}> {name}={quoted(text)!r}: {needed}")
        if any(abs(value) >= most for value in values):
            raise self.fault(f"<{self.tag}> {name}={quoted(text)!r}: too large, less than {most:g} is needed")
        return values


def read_file(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a body's file, read once."""
    where = Path(path)
    if "\0" in str(where):
        raise InputFileNotFoundError(f"{str(where)!r}: a path has no zero bytes; give its name as it is on disk")
    try:
        if where.is_file():
            return where.read_bytes()
        if not where.exists():
            raise no_such_file(where)
        folder = "is a folder, not a file; name the file in it"
        raise InputFileNotFoundError(f"{where}: {folder if where.is_dir() else 'no regular file'}")
    except InputFileNotFoundError:
        raise
    except OSError as error:
        raise InputFileNotFoundError(
            f"{quoted(str(where))}: cannot be read ({error.strerror}); check its name and rights: ls -l"
        ) from None


def xml_text(content: bytes, where: str) -> str:
    """The text of an XML file, without what editors and downloads put around it.

    A byte order mark, blank lines before the declaration and zero bytes at the end are left out; lines are counted as
    in the file. Raises ModelFileError for bytes that are not text in UTF-8 or the encoding that the file states.
    """
    stated = _DECLARED.match(content.lstrip())
    # UTF-8 first: bytes that it allows are hardly ever another encoding, whatever the file states.
    encodings = ["utf-16"] if content.startswith(_UTF_16) else ["utf-8-sig", *([stated[1].decode()] if stated else [])]
    starts: list[int] = []
    for encoding in encodings:
        try:
            text = content.decode(encoding)
            break
        except UnicodeDecodeError as error:
            starts.append(error.start)
        except LookupError:
            continue
    else:
        line = content.count(b"\n", 0, starts[0]) + 1
        raise ModelFileError(f"{where}:{line}: not UTF-8 text, byte {starts[0]} cannot be read; save the file as UTF-8")
    text = text.rstrip("\0 \t\r\n")
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ModelFileError(f"{where}:{line}: a zero byte within the text: the file is damaged; download it again")
    return text


def xml_tree(content: bytes, where: str) -> Node:
    """The root element of an XML file; `where` names the file in messages."""
    text = xml_text(content, where)
    builder = _Builder(where, above=text[: len(text) - len(text.lstrip())].count("\n"))
    try:
        # The whole buffer at once: in pieces a long token costs the square of its length.
        builder.parser.Parse(text.lstrip().encode(), True)
    except expat.ExpatError as error:
        line = error.lineno + builder.above
        open_one = builder.open[-1] if builder.open else None
        after = f"; <{quoted(open_one.tag)}> of line {open_one.line} is not closed there" if open_one else ""
        raise ModelFileError(
            f"{where}:{line}: not well-formed XML: {expat.ErrorString(error.code)}: line {line}, column "
            f"{error.offset + 1}{after}; correct this line"
        ) from None
    return builder.root


class _Builder:
    """Callbacks of expat, element by element.

    Tags keep their prefix, as in "drake:joint", whatever address it stands for: programs that read robots go by it.
    """

    root: Node

    def __init__(self, where: str, above: int) -> None:
        self.where, self.above = where, above
        # The text was encoded in UTF-8, whatever the declaration states.
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.open: list[Node] = []

    def _doctype(self, *_: object) -> None:
        line = self.parser.CurrentLineNumber + self.above
        raise ModelFileError(f"{self.where}:{line}: a document type (DTD) is not read; remove the <!DOCTYPE>")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        attributes.pop("xmlns", None)
        node = Node(tag, attributes, self.where, self.parser.CurrentLineNumber + self.above)
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


def listed(names: Sequence[str], most: int = 50) -> str:
    """Names for a message, the first of many."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


@lru_cache(maxsize=1024)
def _near(name: str, known: tuple[str, ...]) -> str | None:
    """The known name closest to a misspelt one; None for a known name, or one far from all."""
    if name in known or len(name) > _MOST_QUOTED:
        return None
    near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.75)
    return near[0] if near else None
