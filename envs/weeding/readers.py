"""Strips of field from what people have already: CropAndWeed's csv, COCO boxes as Weed-COCO uses them, GeoJSON points.

Pictures are taken to be seen straight from above. The machine drives to the right in them (``heading="x"``: along is
x, across is upwards from the middle) or upwards (``heading="y"``: along is upwards, across is to the left from the
middle). The strip begins at the picture's edge.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from ...kernels.config_kinds import file_name, show
from ..assembly import choice, meant
from ..field import ABSENT, FieldError
from ..field_files import read_text
from ..field_geojson import checked_features, object_lines, parsed, point
from ..field_rows import scaling
from .config import SPECIES, STAGES
from .field import Crops, WeedField, Weeds
from .species import CROP, CROP_AND_WEED, LEFT_OUT, checked_mapping, classified

FORMATS = ("cropandweed", "coco", "geojson")
HEADINGS = ("x", "y")
PICTURE_PX = (1920, 1088)
"""Width and height of CropAndWeed's pictures."""
_CELLS = ("Left", "Top", "Right", "Bottom", "LabelID", "StemX", "StemY")
_STAGE_FROM_M = {SPECIES[0]: (0.026, 0.045), SPECIES[1]: (0.038, 0.068)}
"""Longer side of the box from which a broadleaf or a grass has two leaves, and four; between the sizes of the rendered
ones [assumed]."""


Window = Mapping[str, tuple[float, float]]


class Found(NamedTuple):
    """A plant of a data set.

    Attributes:
        what: ``CROP`` or one of ``SPECIES``.
        along_m: along the row.
        across_m: across it, left of the way positive.
        stage: one of ``STAGES``, empty where nothing tells.
        line: of the file.
    """

    what: str
    along_m: float
    across_m: float
    stage: str
    line: int


class _Ground(NamedTuple):
    """From pixels to places: metres a pixel, width and height of the picture, and its heading."""

    scale: float
    size_px: tuple[float, float]
    heading: str

    def place(self, x: float, y: float) -> tuple[float, float]:
        width, height = self.size_px
        if self.heading == "x":
            return self.scale * x, self.scale * (0.5 * height - y)
        return self.scale * (height - y), self.scale * (0.5 * width - x)


def read_plants(
    path: str | PathLike[str],
    form: str,
    scale: float | None = None,
    species: Mapping[str, str] | None = None,
    heading: str = "x",
    image: str | None = None,
    size_px: tuple[float, float] = PICTURE_PX,
) -> list[Found]:
    """The plants in a data set's file.

    Args:
        path: the file.
        form: ``"cropandweed"`` (``Left,Top,Right,Bottom,LabelID,StemX,StemY``, with or without this header; a plant
            stands at its stem), ``"coco"`` (a plant stands at its first visible keypoint, without any in the middle of
            its box), or ``"geojson"`` (points, along and across, whose property ``species`` or ``kind`` says what they
            are; their ``stage`` is kept).
        scale: metres a pixel; for ``"geojson"`` metres a unit of its coordinates, by default 1.
        species: what a species counts as, ``"crop"``, ``"broadleaf"``, ``"grass"`` or ``"left-out"``, by name, genus or
            label id; it goes before what is known already (see ``species``).
        heading: where the machine drives in the picture, ``"x"`` or ``"y"``.
        image: name or id of a COCO file's picture; may be left out where there is one.
        size_px: width and height of CropAndWeed's pictures.

    Raises:
        FieldError: the file is none of these, or a species is unknown; one line with file, line and what to do.
    """
    mapping, file = checked_mapping(species or {}), file_name(path)
    try:
        choice("form", form, FORMATS)
        choice("heading", heading, HEADINGS)
    except ValueError as error:
        raise FieldError(str(error)) from None
    if form == "geojson":
        return _geojson(read_text(path), file, mapping, 1.0 if scale is None else scale)
    scaling("px", scale)
    ground = _Ground(float(scale or 0.0), size_px, heading)
    if form == "coco":
        return _coco(read_text(path), file, mapping, ground, image)
    return _crop_and_weed(read_text(path), file, mapping, ground)


def weed_field(plants: Sequence[Found], window: Window | None = None) -> WeedField:
    """A strip with these plants; what a data set does not tell is absent.

    Args:
        plants: in any order.
        window: by column, the range outside of which plants are left out.
    """
    kept = [plant for plant in plants if _inside(plant, window or {})]
    weeds, crops = ([plant for plant in kept if (plant.what == CROP) is is_crop] for is_crop in (False, True))
    stages = [STAGES.index(plant.stage) if plant.stage else ABSENT for plant in weeds]
    species = [SPECIES.index(plant.what) for plant in weeds]
    return WeedField(
        replace(Weeds.empty(len(weeds)), **_places(weeds), species=np.array(species, int), stage=np.array(stages, int)),
        replace(Crops.empty(len(crops)), **_places(crops)),
    )


def _places(plants: Sequence[Found]) -> dict[str, Any]:
    return {name: np.array([getattr(plant, name) for plant in plants], float) for name in ("along_m", "across_m")}


def _inside(plant: Found, window: Window) -> bool:
    return all(low <= getattr(plant, name) <= high for name, (low, high) in window.items())


def _crop_and_weed(text: str, file: str, mapping: Mapping[str, str], ground: _Ground) -> list[Found]:
    found: list[Found] = []
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            where = f"{file}:{reader.line_num}"
            header = [cell.strip().lower() for cell in cells] == [cell.lower() for cell in _CELLS]
            if header or not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(_CELLS):
                raise FieldError(f"{where}: has {len(cells)} cells: give {','.join(_CELLS)}")
            left, top, right, bottom, label, x, y = (
                _finite(_as_number(cell), name, where) for cell, name in zip(cells, _CELLS, strict=True)
            )
            name = f"{label:g}"
            if name not in mapping and name not in CROP_AND_WEED:
                raise FieldError(f"{where}: LabelID {name} is unknown: known are 1 to 99 and 255, or map it to a class")
            what = mapping.get(name) or CROP_AND_WEED[name]
            if what != LEFT_OUT:
                stage = _stage(what, ground.scale * max(right - left, bottom - top))
                found.append(Found(what, *ground.place(x, y), stage, reader.line_num))
    except csv.Error as error:
        raise FieldError(f"{file}:{reader.line_num}: is no CSV ({error}): mend the line") from None
    return found


def _coco(text: str, file: str, mapping: Mapping[str, str], ground: _Ground, image: str | None) -> list[Found]:
    data = parsed(text, file)
    images, annotations, categories = (_listed(data, name, file) for name in ("images", "annotations", "categories"))
    names = {show(category.get("id")): category.get("name") for category in categories}
    picture = _picture(images, image, file)
    size = tuple(_finite(picture.get(name), f"{name} of its picture", file) for name in ("width", "height"))
    ground = ground._replace(size_px=size)
    lines, found = object_lines(text, "annotations", len(annotations)), []
    for annotation, line in zip(annotations, lines, strict=True):
        where = f"{file}:{line}"
        if annotation.get("image_id") != picture.get("id"):
            continue
        name = names.get(show(annotation.get("category_id")))
        if not isinstance(name, str):
            raise FieldError(f"{where}: category {show(annotation.get('category_id'))} has no name: add it")
        what = classified(name, mapping, where)
        if what != LEFT_OUT:
            x, y, size_px = _stem(annotation, where)
            stage = _stage(what, ground.scale * size_px) if size_px else ""
            found.append(Found(what, *ground.place(x, y), stage, line))
    return found


def _listed(data: Any, name: str, file: str) -> list[Mapping[str, Any]]:
    items = data.get(name) if isinstance(data, Mapping) else None
    if not isinstance(items, list) or not all(isinstance(item, Mapping) for item in items):
        raise FieldError(f"{file}: {name} = {show(items)}: give a COCO file, with a list of objects as {name!r}")
    return items


def _picture(images: Sequence[Mapping[str, Any]], image: str | None, file: str) -> Mapping[str, Any]:
    called = {str(item.get(key)): item for item in images for key in ("id", "file_name")}
    if image is not None:
        if image not in called:
            raise FieldError(f"{file}: has no image {show(image)}: {meant(image[:40], tuple(called)[:12])}")
        return called[image]
    if len(images) != 1:
        few = ", ".join(show(item.get("file_name", item.get("id"))) for item in images[:3])
        raise FieldError(
            f"{file}: has {len(images)} images: name one, such as {few}" if images else f"{file}: no image"
        )
    return images[0]


def _stem(annotation: Mapping[str, Any], where: str) -> tuple[float, float, float]:
    """Pixels of where a plant stands, and the longer side of its box, 0 where it has none."""
    box, points = annotation.get("bbox"), annotation.get("keypoints")
    size = left = top = width = height = 0.0
    if box is not None:
        if not isinstance(box, list) or len(box) != 4:
            raise FieldError(f"{where}: bbox = {show(box)}: give left, top, width and height")
        left, top, width, height = (_finite(value, "bbox", where) for value in box)
        size = max(width, height)
    if isinstance(points, list) and len(points) % 3 == 0:
        for x, y, seen in zip(*[iter(points)] * 3, strict=True):
            if _finite(seen, "keypoints", where) > 0:
                return _finite(x, "keypoints", where), _finite(y, "keypoints", where), size
    if box is None:
        raise FieldError(f"{where}: has neither keypoints nor a bbox: give one of them")
    return left + 0.5 * width, top + 0.5 * height, size


def _geojson(text: str, file: str, mapping: Mapping[str, str], scale: float) -> list[Found]:
    _finite(scale, "scale", file)
    features, found = checked_features(parsed(text, file), file), []
    for feature, line in zip(features, object_lines(text, "features", len(features)), strict=True):
        where = f"{file}:{line}"
        coordinates, properties = point(feature, where)
        name, stage = properties.get("species") or properties.get("kind"), properties.get("stage") or ""
        if not isinstance(name, str):
            raise FieldError(f"{where}: its species is {show(name)}: give it a property 'species' with a name")
        if stage not in ("", *STAGES):
            raise FieldError(f"{where}: stage {show(stage)} is unknown: {meant(str(stage)[:40], STAGES)}")
        if len(coordinates) < 2:
            raise FieldError(f"{where}: {len(coordinates)} coordinates: give 2, along and across")
        what = classified(name, mapping, where)
        along, across = (scale * _finite(value, "coordinates", where) for value in coordinates[:2])
        if what != LEFT_OUT:
            found.append(Found(what, along, across, stage, line))
    return found


def _stage(what: str, size_m: float) -> str:
    """The stage of a weed whose box is this long; nothing of a crop plant."""
    return "" if what == CROP else STAGES[sum(size_m >= limit for limit in _STAGE_FROM_M[what])]


def _as_number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def _finite(value: Any, name: str, where: str) -> float:
    try:
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    except OverflowError:
        pass
    raise FieldError(f"{where}: {name} = {show(value)} is no finite number: give one")
