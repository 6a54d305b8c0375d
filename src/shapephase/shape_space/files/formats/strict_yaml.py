"""YAML as files of numbers need it: values as they were written, and no key twice."""

from __future__ import annotations

from typing import Any

from ....errors import MissingExtraError, TrajectoryError

_MERGE = "<<"  # YAML 1.1 merges the value of this key into its mapping


class Word(str):
    """A value as it was written, and its line: `1e-3` is a text in YAML 1.1, `on` is true and 012 is ten."""

    line: int


def yaml_documents(text: str, where: str) -> list[Any]:
    """Documents of a YAML text that are not empty: dictionaries by text, lists, and `Word`s.

    Raises MissingExtraError without PyYAML. Raises TrajectoryError for text that is not YAML, unknown tags, doubled
    keys and merge keys; the line is named.
    """
    try:
        import yaml
    except ImportError:
        raise MissingExtraError("YAML files need PyYAML; install it with: pip install 'shapephase[ros]'") from None

    # Without resolvers, plain values are texts.
    safe = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    texts: Any = type("_TextLoader", (safe,), {"yaml_implicit_resolvers": {}})

    def as_text(_: Any, node: Any) -> Word:
        value = Word(node.value)
        value.line = node.start_mark.line + 1
        return value

    def as_mapping(loader: Any, node: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key, place = loader.construct_object(key_node, deep=True), f"line {key_node.start_mark.line + 1}"
            if not isinstance(key, Word) or key == _MERGE or key in found:
                fault = "a key must be a plain word" if not isinstance(key, Word) else f"{key!r:.60} stands twice"
                fault = "merge keys (<<) are not read; write the values out" if key == _MERGE else fault
                raise TrajectoryError(f"{where}: {place}: {fault}")
            found[key] = loader.construct_object(value_node, deep=True)
        return found

    texts.add_constructor("tag:yaml.org,2002:str", as_text)
    texts.add_constructor("tag:yaml.org,2002:map", as_mapping)
    try:
        return [document for document in yaml.load_all(text, texts) if document not in (None, "")]
    except (yaml.YAMLError, RecursionError) as error:
        raise TrajectoryError(f"{where}: no YAML: {' '.join(str(error).split()):.200}; write it anew") from None
