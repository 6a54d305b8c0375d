"""The part of YAML that files of numbers need: mappings, lists and plain words; no aliases, no tags."""

from __future__ import annotations

from typing import Any, NamedTuple

from ....errors import MissingExtraError, TrajectoryError

# Lists and mappings inside each other: a ROS message nests half as many.
_MOST_DEPTH = 16
# A key whose value YAML 1.1 takes for part of the mapping around it.
_MERGE = "<<"
# Memory: events of the parser, about one for each value.
_MOST_ENTRIES = 2_000_000


class Word(NamedTuple):
    """A scalar as it was written, and its line."""

    text: str
    line: int


def yaml_documents(text: str, where: str) -> list[Any]:
    """The documents of a YAML text that are not empty: dictionaries by text, lists, and `Word`s.

    Nothing is interpreted: `1e-3`, `on` and `0x1F` are words. Built from the parser's events without recursion, so
    that no text can do more than be long.

    Raises
    ------
    MissingExtraError
        Without PyYAML.
    TrajectoryError
        For what is no YAML, aliases, tags, doubled keys or anchors, or too many or too deep entries; the line is named.
    """
    try:
        import yaml
    except ImportError:
        raise MissingExtraError("YAML files need PyYAML; install it with: pip install 'shapephase[ros]'") from None
    documents: list[Any] = []
    stack: list[Any] = []
    keys: list[str | None] = []
    anchors: set[str] = set()
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        for count, event in enumerate(yaml.parse(text, Loader=loader)):
            if count > _MOST_ENTRIES:
                raise TrajectoryError(f"{where}: more than {_MOST_ENTRIES} entries; use NPZ or a bag for that much")
            place = f"{where}: line {event.start_mark.line + 1}"
            if isinstance(event, yaml.AliasEvent):
                raise TrajectoryError(f"{place}: aliases (*{event.anchor}) are not read; write the value out")
            if isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
                keys.pop()
                stack.pop()
                continue
            if isinstance(event, yaml.DocumentStartEvent):
                anchors.clear()
            if not isinstance(event, yaml.ScalarEvent | yaml.MappingStartEvent | yaml.SequenceStartEvent):
                continue
            if event.anchor in anchors:
                raise TrajectoryError(f"{place}: the anchor &{event.anchor} stands twice; remove anchors")
            if event.anchor is not None:
                anchors.add(event.anchor)
            if event.tag is not None:
                raise TrajectoryError(f"{place}: tags ({event.tag}) are not read; write plain numbers and names")
            if isinstance(event, yaml.ScalarEvent):
                value: Any = Word(event.value, event.start_mark.line + 1)
            else:
                value = {} if isinstance(event, yaml.MappingStartEvent) else []
            if stack and isinstance(stack[-1], dict) and keys[-1] is None:
                if not isinstance(value, Word):
                    raise TrajectoryError(f"{place}: a key must be a plain word")
                if value.text == _MERGE:
                    raise TrajectoryError(f"{place}: merge keys ({_MERGE}) are not read; write the values out")
                if value.text in stack[-1]:
                    raise TrajectoryError(f"{place}: {value.text!r:.60} stands twice")
                keys[-1] = value.text
                continue
            if not stack:
                documents.append(value)
            elif isinstance(stack[-1], dict):
                stack[-1][keys[-1]] = value
                keys[-1] = None
            else:
                stack[-1].append(value)
            if not isinstance(value, Word):
                if len(stack) >= _MOST_DEPTH:
                    raise TrajectoryError(f"{place}: nested deeper than {_MOST_DEPTH}")
                stack.append(value)
                keys.append(None)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        if mark is not None and "nesting depth" in str(error):
            # PyYAML has a limit of its own, and reads ahead.
            raise TrajectoryError(f"{where}: line {mark.line + 1}: nested deeper than {_MOST_DEPTH}") from None
        said = " ".join(str(error).split())
        raise TrajectoryError(f"{where}: no YAML: {said:.200}") from None
    return [document for document in documents if not isinstance(document, Word) or document.text]
