"""What a line of results has to look like: anybody may have edited it, and a disk may have lost a part."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

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


def _numbers(value: Any) -> bool:
    return isinstance(value, list) and all(_number(item) for item in value)


class _Kind(NamedTuple):
    """What a value must be, and that in words."""

    holds: Callable[[Any], bool]
    words: str


_NUMBER = _Kind(_number, "a number")
_KNOWN = _Kind(lambda value: value is None or _number(value), "a number")
_COUNT = _Kind(
    lambda value: isinstance(value, int) and not isinstance(value, bool) and value >= 0, "a whole number from 0 on"
)
_FLAG = _Kind(lambda value: isinstance(value, bool), "true or false")
_TEXT = _Kind(lambda value: isinstance(value, str), "text")
_NAME = _Kind(lambda value: isinstance(value, str) and value != "", "text")
_OBJECT = _Kind(lambda value: isinstance(value, Mapping), "an object")
_SCORES = _Kind(
    lambda value: isinstance(value, Mapping) and all(map(_KNOWN.holds, value.values())), "an object of numbers"
)
_NUMBERS = _Kind(_numbers, "a list of numbers")
_PAIRS = _Kind(
    lambda value: isinstance(value, list) and all(_numbers(item) and len(item) == 2 for item in value),
    "a list of pairs of numbers",
)

_IDENTITY = {
    "env_id": _Kind(lambda value: isinstance(value, str) and _ID.fullmatch(value) is not None, "an id"),
    **dict.fromkeys(("scenario", "backend", "perception", "policy"), _NAME),
    "seed": _COUNT,
}
_EPISODE = {"return": _KNOWN, "steps": _COUNT, "scorecard": _SCORES, "wall_s": _NUMBER, "decision_s": _NUMBER}
_BOUND = {"bound": _OBJECT, "wall_s": _NUMBER}
_BOUND_VALUES = {"net_rate": _KNOWN, "episode_return": _KNOWN, "curve": _PAIRS}
_SPECIAL = {
    "changes": _OBJECT,
    **dict.fromkeys(("fields", "field", "field_digest", "source", "task_source"), _NAME),
    "error": _TEXT,
}
_MAY = {
    "rewards": _SCORES,
    "terminated": _FLAG,
    "curve": _NUMBERS,
    **dict.fromkeys(("last_s", "decision_p95_ms", "decision_before_last_s"), _NUMBER),
}
_BOUND_MAY = {
    "method": _TEXT,
    "proven": _FLAG,
    **dict.fromkeys(("gap", "cycle_time_s"), _KNOWN),
    **dict.fromkeys(("expected", "found"), _OBJECT),
}
_FOUND = {"net_rate": _KNOWN, "episode_return": _KNOWN}
_EXPECTED = {**_FOUND, "method": _TEXT, "estimated": _FLAG}


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
        values = found.get("bound") or {}
        fault = _first(found, _BOUND, True) or _first(values, _BOUND_VALUES, True)
        fault = fault or _first(values, _BOUND_MAY, False)
        for name, kinds in (("expected", _EXPECTED), ("found", _FOUND)):
            fault = fault or (_first(values[name], kinds, True) if name in values else "")
        return fault
    return _first(found, _EPISODE, True) or _first(found, _MAY, False) or _inside(found)


def _first(values: Any, wanted: Mapping[str, _Kind], needed: bool) -> str:
    """The first of the ``wanted`` entries that is missing (where it is needed) or of another kind, in words."""
    for name, kind in wanted.items():
        if name not in values:
            if needed:
                return f"it has no {name}"
        elif not kind.holds(values[name]):
            return f"{name} is {_shown(values[name])}, not {kind.words}"
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
            if not (_OBJECT.holds(value) and all(item is None or _TEXT.holds(item) for item in value.values())):
                return f"{name} is {_shown(value)}, not an object of texts"
        elif not (_TEXT.holds(value) or _number(value)):
            return f"{name} is {_shown(value)}, not text"
    return ""
