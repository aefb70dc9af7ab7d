"""Fields as GeoJSON: rows with a place are points of local metres, the rest stands in their properties."""

from __future__ import annotations

import json
import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import Any

from ..kernels.config_kinds import show
from .field import Field, FieldError
from .field_rows import KIND, Content, Row, same_task

MEMBER = "fieldgym"
"""Foreign member of the collection that says whose field it is."""
LOCAL = "local metres"
_SIGNS = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{}]', re.DOTALL)
_DEGREES = " (these look like degrees of longitude and latitude: give local metres, along and across)"
_LARGEST_SPREAD_DEG = 0.1
"""Fields on degrees spread less than this: ten kilometres."""
_FAR_DEG = 1.0


class _Object(dict[str, Any]):
    """A JSON object that remembers a name that was there twice."""

    def __init__(self, pairs: Sequence[tuple[str, Any]]):
        super().__init__(pairs)
        seen: set[str] = set()
        self.twice = next((name for name, _ in pairs if name in seen or seen.add(name)), None)


def parsed(text: str, file: str) -> Any:
    """The value of a JSON text.

    Raises:
        FieldError: it is none; with the line.
    """
    try:
        return json.loads(text, object_pairs_hook=_Object)
    except json.JSONDecodeError as error:
        if not text.strip():
            raise FieldError(f"{file}: is empty: give a GeoJSON FeatureCollection") from None
        raise FieldError(f"{file}:{error.lineno}: is no JSON ({error.msg}, column {error.colno}): mend it") from None
    except (RecursionError, ValueError):  # nested without end, or a number of thousands of digits
        raise FieldError(f"{file}: is no JSON that can be read: give a GeoJSON FeatureCollection") from None


def geojson_content(text: str, field_type: type[Field], file: str) -> Content:
    """What a GeoJSON text says.

    Raises:
        FieldError: it is no FeatureCollection of points, or one of another task.
    """
    data = parsed(text, file)
    features = checked_features(data, file)
    said = data.get(MEMBER)
    kinds: Sequence[str] = ()
    if said is not None:
        if not isinstance(said, Mapping):
            raise FieldError(f"{file}: member {MEMBER!r} is {show(said)}: give an object, or remove it")
        same_task(said.get("task"), field_type, file)
        listed = said.get("kinds", [])
        if not isinstance(listed, list):
            raise FieldError(f"{file}: kinds = {show(listed)}: give a list of kinds, or remove it")
        kinds = listed
    lines = object_lines(text, "features", len(features))
    rows = [_row(feature, field_type, file, line) for feature, line in zip(features, lines, strict=True)]
    points = [list(feature["geometry"]["coordinates"]) for feature in features if feature.get("geometry")]
    hints = dict.fromkeys(field_type.places, _DEGREES) if _like_degrees(points) else {}
    return Content(rows, kinds, None, hints)


def checked_features(data: Any, file: str) -> list[Any]:
    """The features of a collection.

    Raises:
        FieldError: ``data`` is none.
    """
    if not isinstance(data, Mapping) or data.get("type") != "FeatureCollection":
        what = data.get("type") if isinstance(data, Mapping) else data
        raise FieldError(f"{file}: holds {show(what)}: give a GeoJSON FeatureCollection")
    twice = getattr(data, "twice", None)
    if twice is not None:
        raise FieldError(f"{file}: {show(twice)} is there twice: remove one")
    features = data.get("features")
    if not isinstance(features, list):
        raise FieldError(f"{file}: features = {show(features)}: give a list of features")
    return features


def object_lines(text: str, name: str, count: int) -> list[int]:
    """The line in which every object of the list ``name`` of the outermost object begins.

    Args:
        text: JSON that was parsed.
        name: of the list.
        count: what the list holds; line 1 stands for all where one is no object.
    """
    breaks = [match.start() for match in re.finditer("\n", text)]
    depth, last, begins = 0, "", []
    for match in _SIGNS.finditer(text):
        sign = match[0]
        if sign[0] == '"':
            last = sign if depth == 1 else last
        elif sign in "[{":
            if depth == 2 and last == f'"{name}"' and sign == "{":
                begins.append(bisect_right(breaks, match.start()) + 1)
            depth += 1
        else:
            depth -= 1
    return begins if len(begins) == count else [1] * count


def point(feature: Any, where: str) -> tuple[list[Any], dict[str, Any]]:
    """Coordinates of a feature, empty where it has no geometry, and its properties.

    Raises:
        FieldError: it is no feature, or no point.
    """
    if not isinstance(feature, Mapping) or feature.get("type") != "Feature":
        raise FieldError(f"{where}: holds {show(feature)}: give a Feature")
    properties = feature.get("properties")
    if properties is None:
        properties = {}
    if not isinstance(properties, Mapping):
        raise FieldError(f"{where}: properties = {show(properties)}: give an object")
    geometry = feature.get("geometry")
    for part in (feature, properties, geometry):
        twice = getattr(part, "twice", None)
        if twice is not None:
            raise FieldError(f"{where}: {show(twice)} is there twice: remove one")
    if geometry is None:
        return [], dict(properties)
    if not isinstance(geometry, Mapping) or geometry.get("type") != "Point":
        what = geometry.get("type") if isinstance(geometry, Mapping) else geometry
        raise FieldError(f"{where}: its geometry is {show(what)}: give a Point")
    coordinates = geometry.get("coordinates")
    if not isinstance(coordinates, list):
        raise FieldError(f"{where}: coordinates = {show(coordinates)}: give a list of numbers")
    return coordinates, dict(properties)


def _row(feature: Any, field_type: type[Field], file: str, line: int) -> Row:
    where = f"{file}:{line}"
    coordinates, properties = point(feature, where)
    kind = properties.pop(KIND, field_type.main)
    if coordinates or feature.get("geometry"):
        table = field_type.kinds().get(kind) if isinstance(kind, str) else None
        columns = {} if table is None else table.columns()
        places = [name for name in field_type.places if table is None or name in columns]
        needed = sum(name not in columns or columns[name].required for name in places)
        if not needed <= len(coordinates) <= len(places) or not places:
            wanted = f"{len(places)}, {', '.join(places)}" if places else f"null as geometry: {kind} have no place"
            raise FieldError(f"{where}: {len(coordinates)} coordinates: give {wanted}")
        for name, value in zip(places, coordinates, strict=False):
            if properties.get(name) is not None:
                raise FieldError(f"{where}: {name} stands in geometry and properties: remove one")
            properties[name] = value
    return Row(kind, properties, line)


def _like_degrees(points: Sequence[Sequence[Any]]) -> bool:
    """Whether points could be longitudes and latitudes of one field."""
    pairs = [(p[0], p[1]) for p in points if len(p) > 1 and all(isinstance(value, int | float) for value in p)]
    if not pairs:
        return False
    for values, most in zip(zip(*pairs, strict=True), (180.0, 90.0), strict=True):
        if not all(_FAR_DEG < abs(value) <= most for value in values):
            return False
        if max(values) - min(values) > _LARGEST_SPREAD_DEG:
            return False
    return True


def geojson_text(field: Field) -> str:
    """The GeoJSON text of a field, a feature a line; what is read from it is equal, bit for bit."""
    features = []
    for kind, table in field.tables():
        columns = table.columns()
        places = [name for name in field.places if name in columns]
        listed = {name: values.tolist() for name, values in table.arrays().items()}
        missing = {name: column.missing(getattr(table, name)) for name, column in columns.items()}
        for row in range(len(table)):
            given = {
                name: column.labels[listed[name][row]] if column.labels else listed[name][row]
                for name, column in columns.items()
                if not missing[name][row]
            }
            geometry = None
            if places and all(name in given for name in places):
                geometry = {"type": "Point", "coordinates": [given.pop(name) for name in places]}
            feature = {"type": "Feature", "geometry": geometry, "properties": {KIND: kind, **given}}
            features.append(json.dumps(feature, allow_nan=False))
    said = {"task": field.task, "crs": LOCAL, "kinds": [kind for kind, _ in field.tables()]}
    head = f'{{"type": "FeatureCollection", "{MEMBER}": {json.dumps(said)}, "features": ['
    return head + "\n" + ",\n".join(features) + "\n]}\n"
