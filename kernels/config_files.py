"""Scenario files: YAML, read strictly. What readers of YAML take differently, or a reader may be hurt by, is refused.

No anchors, aliases, tags, merge keys, second documents or repeated names; truth values are ``true`` and ``false``,
whole numbers decimal. As for every reader of YAML 1.1, ``1.0e-3`` is a number and ``1e-3`` a text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from .config_kinds import ConfigError, file_name, label, show
from .files import read_file

MAX_BYTES = 1_000_000
MAX_DEPTH = 32
_MAX_DIGITS = 1000
_TAG = "tag:yaml.org,2002:"


class Located(dict[str, Any]):
    """A mapping of a file that remembers its lines, so that errors can name them.

    Attributes:
        file: name of the file.
        line: where the mapping begins.
        lines: where each name stands.
    """

    def __init__(self, file: str, line: int) -> None:
        """An empty mapping at a line."""
        super().__init__()
        self.file, self.line, self.lines = file, line, dict[str, int]()

    def place(self, path: str) -> str:
        """File and line of a dotted name in it, or of as much of the name as there is."""
        line, node, parts = self.line, self, re.split(r"[.\[]", path)
        while isinstance(node, Located) and parts:
            for count in range(len(parts), 0, -1):
                name = ".".join(parts[:count])
                if name in node.lines:
                    line, node, parts = node.lines[name], node[name], parts[count:]
                    break
            else:
                break
        return f"{self.file}:{line}"


def load_yaml(path: str | PathLike[str]) -> Located:
    """The mapping in a YAML file, for ``from_mapping`` or ``override``, whose errors then name file and line.

    Args:
        path: a file of at most ``MAX_BYTES`` in UTF-8, whose outermost value is a mapping; an empty one gives none.

    Raises:
        ConfigError: the file cannot be read, is no YAML, or is more than this reader takes; with file and line.
    """
    file = file_name(fspath(path))
    try:
        data = read_file(Path(path), MAX_BYTES)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise ConfigError("", f"cannot be read: {reason}", place=file) from None
    try:
        return parse_yaml(data.decode("utf-8"), file)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError("", "is not UTF-8: save it as UTF-8", place=f"{file}:{line}") from None


def parse_yaml(text: str, file: str = "text") -> Located:
    """As ``load_yaml``, from a text; ``file`` is what errors call it."""
    try:
        import yaml
    except ImportError:
        raise ImportError("scenario files need PyYAML: pip install pyyaml") from None
    try:
        return _document(yaml, text, file)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{file}:{mark.line + 1}" if mark else file
        raise ConfigError("", f"no YAML: {error.problem or error.context}", place=place) from None
    except yaml.YAMLError as error:
        raise ConfigError("", f"no YAML: {getattr(error, 'reason', error)}", place=file) from None


def _document(yaml: Any, text: str, file: str) -> Located:
    """Build from events and not by recursion, so that no text can exhaust the stack."""
    root: Any = None
    stack: list[Any] = []  # the open mappings and lists, outermost first
    names: list[tuple[str, int] | None] = []  # of each, the name that waits for its value
    for event, line in _events(yaml, text, file):
        where = f"{file}:{line}"
        if isinstance(event, yaml.CollectionEndEvent):
            stack.pop()
            names.pop()
            continue
        if isinstance(event, yaml.ScalarEvent):
            value = _scalar(yaml, event, where)
        else:
            value = Located(file, line) if isinstance(event, yaml.MappingStartEvent) else []
        parent = stack[-1] if stack else None
        if parent is None:
            root = value
        elif isinstance(parent, list):
            parent.append(value)
        elif (waiting := names[-1]) is not None:
            name, parent.lines[name] = waiting
            parent[name] = value
            names[-1] = None
        elif not isinstance(value, str):
            raise ConfigError("", f"{show(value)} as a name: names are texts, put it in quotes", place=where)
        elif value in parent:
            first = parent.lines[value]
            raise ConfigError("", f"{label(value)} is given twice, first in line {first}: give it once", place=where)
        else:
            names[-1] = (value, line)
        if isinstance(value, (list, Located)):
            stack.append(value)
            names.append(None)
            if len(stack) > MAX_DEPTH:
                raise ConfigError("", f"more than {MAX_DEPTH} levels inside each other: give fewer", place=where)
    if root is None:
        return Located(file, 1)
    if not isinstance(root, Located):
        raise ConfigError("", f"holds {show(root)}: give a mapping, name: value", place=f"{file}:1")
    return root


def _events(yaml: Any, text: str, file: str) -> Iterator[tuple[Any, int]]:
    """Values, beginnings and ends of the only document, with their lines."""
    documents = 0
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        line = event.start_mark.line + 1
        where = f"{file}:{line}"
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise ConfigError("", "a second document begins: give one", place=where)
        elif isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise ConfigError("", f"anchor or alias {label(event.anchor)}: write the value out", place=where)
        elif getattr(event, "tag", None) is not None:
            raise ConfigError("", f"tag {show(event.tag)}: leave tags out", place=where)
        elif isinstance(event, (yaml.ScalarEvent, yaml.CollectionStartEvent, yaml.CollectionEndEvent)):
            yield event, line


def _scalar(yaml: Any, event: Any, where: str) -> Any:
    """Value of a scalar after YAML 1.1, without what reads otherwise than it looks."""
    text = event.value
    if not event.implicit[0]:  # in quotes
        return text
    candidates = yaml.SafeLoader.yaml_implicit_resolvers.get(text[:1], [])
    tag = next((tag for tag, pattern in candidates if pattern.match(text)), _TAG + "str").removeprefix(_TAG)
    if tag == "str":
        return text
    if tag == "null":
        return None
    if tag == "bool" and text.lower() in ("true", "false"):
        return text.lower() == "true"
    if tag == "int" and len(text) <= _MAX_DIGITS and re.fullmatch(r"[-+]?(0|[1-9][0-9]*)", text):
        return int(text)
    if tag == "float" and len(text) <= _MAX_DIGITS and not re.search("[:_]", text):
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    advice = {"bool": "YAML reads it as a truth value: write true or false, or put a text in quotes"}
    if tag in ("int", "float"):
        advice[tag] = "YAML reads it otherwise than it looks: write a decimal number, or put a text in quotes"
    raise ConfigError("", f"{show(text)}: {advice.get(tag, 'put a text in quotes')}", place=where)
