"""What a line of results has to look like: anybody may have edited it, and a disk may have lost a part."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from .record import Record
from .suites import BOUND

LARGEST = 1e100
"""No result is larger; sums and squares of what is smaller stay finite."""
_MOST_DIGITS = 100
_ID = re.compile(r"(?:[^\W\d]\w*(?:\.[^\W\d]\w*)*:)?[\w./-]+")


def parsed(line: bytes, bounds: bool) -> Record:
    """The record in a line.

    Args:
        line: of a file of JSON lines.
        bounds: whether the file holds bounds instead of episodes.

    Raises:
        ValueError: it holds none; the message says why.
    """
    found = _value(line)
    fault = _fault(found, bounds)
    if fault:
        raise ValueError(fault)
    return found


def parsed_manifest(data: bytes) -> dict[str, Any]:
    """A folder's manifest.

    Raises:
        ValueError: it is none; the message says why.
    """
    found = _value(data)
    fault = _manifest_fault(found)
    if fault:
        raise ValueError(fault)
    return found


def _value(data: bytes) -> Any:
    """The JSON value in ``data``, all its numbers finite and all its texts writable."""
    try:
        found = json.loads(data.decode("utf-8"), parse_constant=_constant, parse_float=_float, parse_int=_int)
        if b"\\u" in data:
            json.dumps(found, ensure_ascii=False).encode("utf-8")  # half a character cannot be written again
    except UnicodeError:
        raise ValueError("it is no UTF-8") from None
    except json.JSONDecodeError:
        raise ValueError("it is no JSON") from None
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    return found


def _constant(text: str) -> float:
    raise ValueError(f"{text} is no number")


def _float(text: str) -> float:
    value = float(text)
    if not abs(value) <= LARGEST:
        raise ValueError(f"{text[:20]} is too large")
    return value


def _int(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"{text[:20]}... is too large")
    return int(text)


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number_or_none(value: Any) -> bool:
    return value is None or _number(value)


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _named(value: Any) -> bool:
    return _text(value) and value != ""


def _mapping(value: Any) -> bool:
    return isinstance(value, Mapping)


def _scores(value: Any) -> bool:
    return _mapping(value) and all(_number_or_none(item) for item in value.values())


def _numbers(value: Any) -> bool:
    return isinstance(value, list) and all(_number(item) for item in value)


def _pairs(value: Any) -> bool:
    return isinstance(value, list) and all(_numbers(item) and len(item) == 2 for item in value)


_IDENTITY: dict[str, tuple[Any, str]] = {
    "env_id": (lambda value: _text(value) and _ID.fullmatch(value), "an id"),
    "scenario": (_named, "text"),
    "backend": (_named, "text"),
    "perception": (_named, "text"),
    "policy": (_named, "text"),
    "seed": (_count, "a whole number from 0 on"),
}
_EPISODE: dict[str, tuple[Any, str]] = {
    "return": (_number_or_none, "a number"),
    "steps": (_count, "a whole number from 0 on"),
    "scorecard": (_scores, "an object of numbers"),
    "wall_s": (_number, "a number"),
    "decision_s": (_number, "a number"),
}
_BOUND: dict[str, tuple[Any, str]] = {"bound": (_mapping, "an object"), "wall_s": (_number, "a number")}
_BOUND_VALUES: dict[str, tuple[Any, str]] = {
    "net_rate": (_number_or_none, "a number"),
    "episode_return": (_number_or_none, "a number"),
    "curve": (_pairs, "a list of pairs of numbers"),
}
_SPECIAL: dict[str, tuple[Any, str]] = {
    "changes": (_mapping, "an object"),
    **dict.fromkeys(("fields", "field", "field_digest", "source", "task_source"), (_named, "text")),
    "error": (_text, "text"),
}
_MAY: dict[str, tuple[Any, str]] = {
    "rewards": (_scores, "an object of numbers"),
    "terminated": (lambda value: isinstance(value, bool), "true or false"),
    "curve": (_numbers, "a list of numbers"),
    **dict.fromkeys(("last_s", "decision_p95_ms", "decision_before_last_s"), (_number, "a number")),
}
_BOUND_MAY: dict[str, tuple[Any, str]] = {
    "method": (_text, "text"),
    "proven": (lambda value: isinstance(value, bool), "true or false"),
    "gap": (_number_or_none, "a number"),
    "cycle_time_s": (_number_or_none, "a number"),
}


def _fault(found: Any, bounds: bool) -> str:
    """What is wrong with a line's value, in words; empty when nothing is."""
    if not isinstance(found, dict):
        return "it is no object"
    fault = _first(found, _IDENTITY, True) or _first(found, _SPECIAL, False)
    if fault:
        return fault
    if ("fields" in found) != ("field" in found):
        return "it has a field without its folder" if "field" in found else "it has a folder of fields without a field"
    if (found["policy"] == BOUND) != bounds:
        return "it is a bound among episodes" if not bounds else "it is an episode among bounds"
    if "error" in found:
        return ""
    if bounds:
        values = found.get("bound")
        return _first(found, _BOUND, True) or _first(values, _BOUND_VALUES, True) or _first(values, _BOUND_MAY, False)
    return _first(found, _EPISODE, True) or _first(found, _MAY, False) or _inside(found)


def _first(values: Any, wanted: Mapping[str, tuple[Any, str]], needed: bool) -> str:
    """The first of the ``wanted`` entries that is missing (where it is needed) or of another kind, in words."""
    for name, (right, kind) in wanted.items():
        if name not in values:
            if needed:
                return f"it has no {name}"
        elif not right(values[name]):
            return f"{name} is {_shown(values[name])}, not {kind}"
    return ""


def _inside(record: Record) -> str:
    """What the scorecard lacks that others of the record's entries need."""
    card = record["scorecard"]
    needed = ["net_rate", *(["duration_s"] if record.get("curve") else [])]
    for name in needed:
        if name not in card:
            return f"its scorecard has no {name}"
    if record.get("curve") and not (_number(card["duration_s"]) and card["duration_s"] >= 0.0):
        return f"its duration_s is {_shown(card['duration_s'])}, not a number from 0 on"
    return ""


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _manifest_fault(found: Any) -> str:
    """What is wrong with a manifest, in words; empty when nothing is."""
    if not isinstance(found, dict):
        return "it is no object"
    for name, value in found.items():
        if name in ("packages", "sources"):
            if not (_mapping(value) and all(item is None or _text(item) for item in value.values())):
                return f"{name} is {_shown(value)}, not an object of texts"
        elif not (_text(value) or _number(value)):
            return f"{name} is {_shown(value)}, not text"
    return ""
