"""Fields in files: what is written comes back bit for bit, and what cannot be read is told in one line."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from fieldgym.envs.field import Array, Field, FieldError, Flags, Table, Whole, flag, label, number, whole
from fieldgym.envs.field_files import MAX_BYTES, read_field, write_field

pytestmark = pytest.mark.portable

STAGES = ("bud", "open", "dry")


@dataclass(frozen=True, eq=False)
class Heads(Table):
    along_m: Array = number("m", 0.0, 4.0, "place along the row")
    across_m: Array = number("m", -0.4, 0.4, "place across the row")
    stage: Whole = label(STAGES, "how far it is open")
    mass_g: Array = number("g", 0.0, 9.0, "useful filaments", fill=1.5)
    shoots: Whole = whole(0, 9, "shoots on its stem", fill=2)
    hidden: Flags = flag("behind a leaf", fill=0)
    stands: Flags = flag("on a stem of its own", fill=1)
    luck: Array = number("", -9.0, 9.0, "decides the cut", fill="normal")


@dataclass(frozen=True, eq=False)
class Weather(Table):
    wind_m_s: Array = number("m/s", 0.0, 30.0, "mean wind", fill=0.0)


@dataclass(frozen=True, eq=False)
class Reports(Table):
    along_m: Array = number("m", -1.0, 5.0, "reported place along the row")
    across_m: Array = number("m", -1.0, 1.0, "reported place across the row")
    head: Whole = whole(0, 999, "number of the head behind it", fill="task")
    sure: Flags = flag("whether the camera is sure")


@dataclass(frozen=True, eq=False)
class RowField(Field):
    task: ClassVar[str] = "rows"
    main: ClassVar[str] = "head"

    head: Heads
    weather: Weather
    report: Reports | None = None


def drawn(seed: int, heads: int = 7, reports: int | None = 5) -> RowField:
    """A field with everything in it: values of all magnitudes, negative zeros, absent values, an empty table."""
    g = np.random.default_rng(seed)
    mass_g = np.where(g.random(heads) < 0.3, -np.nan, 9.0 ** -g.integers(0, 200, heads).astype(float))
    table = Heads(
        along_m=4.0 * g.random(heads),
        across_m=np.where(g.random(heads) < 0.2, -0.0, 0.8 * g.random(heads) - 0.4),
        stage=g.integers(0, 3, heads),
        mass_g=mass_g,
        shoots=g.integers(-1, 9, heads),
        hidden=g.random(heads) < 0.5,
        stands=g.random(heads) < 0.5,
        luck=np.clip(g.standard_normal(heads), -9, 9),
    )
    if reports is None:
        return RowField(table, Weather(g.random(1)), None)
    seen = Reports(
        along_m=np.repeat(g.random(1), reports),
        across_m=np.repeat(g.random(1), reports),
        head=g.integers(-1, 9, reports),
        sure=g.random(reports) < 0.5,
    )
    return RowField(table, Weather(g.random(1)), seen)


@pytest.mark.parametrize("ending", ["csv", "geojson"])
@pytest.mark.parametrize("reports", [None, 0, 5])
def test_what_is_written_comes_back_bit_for_bit(tmp_path: Path, ending: str, reports: int | None):
    path = tmp_path / f"f.{ending}"
    for seed in range(20):
        field = drawn(seed, heads=seed % 8, reports=reports)
        write_field(field, path)
        back = read_field(path, RowField)
        assert back.digest() == field.digest()
        assert (back.report is None) == (reports is None)
        assert "np." not in path.read_text()
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_rows_with_a_place_are_points(tmp_path: Path):
    write_field(drawn(0, heads=1, reports=1), tmp_path / "f.geojson")
    data = json.loads((tmp_path / "f.geojson").read_text())
    assert [feature["geometry"] and feature["geometry"]["type"] for feature in data["features"]] == [
        "Point",
        None,
        "Point",
    ]
    assert data["fieldgym"] == {"task": "rows", "crs": "local metres", "kinds": ["head", "weather", "report"]}
    assert "along_m" not in data["features"][0]["properties"]


def test_files_that_cannot_be_read_or_written(tmp_path: Path):
    missing, folder = tmp_path / "no.csv", tmp_path / "folder.csv"
    folder.mkdir()
    for path in (missing, folder):
        with pytest.raises(FieldError) as told:
            read_field(path, RowField)
        assert str(told.value) == f"{path}: there is no such file"
    with pytest.raises(FieldError) as told:
        write_field(drawn(0), tmp_path / "no" / "f.csv")
    assert str(told.value) == f"{tmp_path / 'no' / 'f.csv'}: cannot be written (No such file or directory)"
    with pytest.raises(FieldError, match=r"give a \.csv or a \.geojson file: rows has no other form"):
        read(tmp_path, "o o\n", "f.txt")
    with pytest.raises(FieldError, match="there is no such file"):
        read_field("a\x00.csv", RowField)
    wild = drawn(0)
    object.__setattr__(wild.weather, "wind_m_s", np.array([np.inf]))
    with pytest.raises(FieldError, match="weather 1: wind_m_s = inf m/s: give 0 to 30 m/s"):
        write_field(wild, tmp_path / "f.csv")
    write_field(drawn(0), tmp_path / "f.csv")
    with pytest.raises(FieldError, match="is larger than"):
        with open(tmp_path / "large.csv", "wb") as stream:
            stream.truncate(MAX_BYTES + 1)
        read_field(tmp_path / "large.csv", RowField)


def read(tmp_path: Path, text: str | bytes, name: str = "f.csv", **how: object) -> RowField:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_field(path, RowField, **how)  # type: ignore[arg-type]


def test_a_short_file_of_the_main_kind(tmp_path: Path):
    text = "\ufeff# counted by hand\n\nstage,along_m, across_m ,hidden,stands\r\n"
    text += "open,0.5,-0.1,1,0\r\n,,,,\r\ndry,1.5e0,.2,,\r\n"
    field = read(tmp_path, text)
    assert field.head.along_m.tolist() == [0.5, 1.5]
    assert field.head.across_m.tolist() == [-0.1, 0.2]
    assert field.head.stage.tolist() == [1, 2]
    assert field.head.hidden.tolist() == [True, False]
    assert field.head.stands.tolist() == [False, True]
    assert np.isnan(field.head.mass_g).all()
    assert field.head.shoots.tolist() == [-1, -1]
    assert field.report is None
    assert len(field.weather) == 0
    assert field.origin is not None
    assert field.origin.lines["head"] == [4, 6]


def test_places_come_first_whatever_the_declaration_s_order(tmp_path: Path):
    @dataclass(frozen=True, eq=False)
    class Marks(Table):
        name: Whole = label(("here", "there"), "which mark")
        along_m: Array = number("m", 0.0, 4.0, "place along the row")

    @dataclass(frozen=True, eq=False)
    class MarkField(Field):
        task: ClassVar[str] = "marks"
        main: ClassVar[str] = "mark"

        mark: Marks

    write_field(MarkField(Marks(np.array([1]), np.array([2.5]))), tmp_path / "f.csv")
    assert (tmp_path / "f.csv").read_text().splitlines()[1:] == ["kind,along_m,name", "mark,2.5,there"]


@pytest.mark.parametrize(
    ("unit", "scale", "said", "metres"),
    [("mm", None, "12.5", 0.0125), ("cm", None, "3", 0.03), ("px", 0.0005, "100", 0.05), ("m", None, "0.3", 0.3)],
)
def test_lengths_are_scaled_and_nothing_else(tmp_path: Path, unit: str, scale: float | None, said: str, metres: float):
    field = read(tmp_path, f"along_m,across_m,stage,mass_g\n{said},0,bud,2\n", unit=unit, scale=scale)
    assert field.head.along_m.tolist() == [metres]
    assert field.head.mass_g.tolist() == [2.0]
    collection = {"type": "FeatureCollection", "features": [feature(float(said), 0.0)]}
    assert read(tmp_path, json.dumps(collection), "f.json", unit=unit, scale=scale).head.along_m.tolist() == [metres]


def feature(*place: object, **properties: object) -> dict[str, object]:
    geometry = {"type": "Point", "coordinates": list(place)}
    return {"type": "Feature", "geometry": geometry, "properties": {"stage": "bud", **properties}}


HEAD = "along_m,across_m,stage"
ROW = "1,0,bud"


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("", 0, "is empty"),
        ("\n\n", 0, "is empty: give a header, kind,along_m,across_m,stage"),
        (f"along,across_m,stage\n{ROW}\n", 1, "column 'along' is unknown: did you mean 'along_m'?"),
        ("along_m,stage\n1,bud\n", 1, "column 'across_m' is missing: a head needs it"),
        (f"{HEAD},stage\n1,0,bud,bud\n", 1, "column 'stage' is there twice"),
        (f"{HEAD},\n1,0,bud,\n", 1, "column 4 has no name"),
        ("along_m;across_m;stage\n1;0;bud\n", 1, "parted by semicolons"),
        (f"# note\nkind,{HEAD}\nheads,{ROW}\n", 3, "kind 'heads' is unknown: did you mean 'head'?"),
        (f"kind,{HEAD}\n# note,{ROW}\n", 2, "a comment between the rows"),
        (f"{HEAD}\n1,0,opened\n", 2, "stage = 'opened' is unknown: did you mean 'open'?"),
        (f"{HEAD}\n{ROW}\none,0,bud\n", 3, "along_m = 'one' is no number: give a number, 0 to 4 m"),
        (f"{HEAD}\nnan,0,bud\n", 2, "along_m = 'nan' is no number"),
        (f"{HEAD}\n1e999,0,bud\n", 2, "is no finite number"),
        (f"{HEAD}\n1_0,0,bud\n", 2, "is no number"),
        (f"{HEAD},shoots\n{ROW},1.5\n", 2, "shoots = '1.5' is no whole number: give one, 0 to 9, or leave it out"),
        (f"{HEAD},shoots\n{ROW},1e300\n", 2, "is no whole number"),
        (f"{HEAD},hidden\n{ROW},yes\n", 2, "hidden = 'yes' is no truth value: give 0 or 1"),
        (f"{HEAD}\n{ROW}\n,0,bud\n", 3, "along_m is missing"),
        (
            f"{HEAD}\n{ROW}\n1180,0,bud\n",
            3,
            "along_m = 1180 m: give 0 to 4 m (is the file in mm? then read it with that unit)",
        ),
        (f"{HEAD}\n5,0,bud\n", 2, "along_m = 5 m: give 0 to 4 m"),
        (f"{HEAD}\n2,0,bud\n{ROW}\n1.0,-0,dry\n", 4, "along_m = 1, across_m = 0 is there twice, first in line 3"),
        (f"{HEAD}\n1,0\n", 2, "has 2 cells, the header 3"),
        (f'{HEAD}\n1,0,"bud\n', 2, "is no CSV"),
        (f"kind,{HEAD},wind_m_s\nhead,{ROW},3\n", 2, "head has no column 'wind_m_s'"),
        (f"kind,{HEAD},sure\nreport,1,0,,\n", 2, "sure is missing: give 0 or 1"),
        ("# fieldgym field of trays; kinds: head\n", 1, "is a field of 'trays': this task takes one of 'rows'"),
        (f"# fieldgym field of rows; kinds: beds\n{HEAD}\n", 0, "kind 'beds' is unknown"),
        (f"{HEAD}\n1,0,b\xfcd\n".encode("latin-1"), 2, "is not UTF-8"),
        (HEAD.encode("utf-16"), 1, "is not UTF-8"),
    ],
)
def test_a_csv_that_cannot_be_read(tmp_path: Path, text: str | bytes, line: int, says: str):
    with pytest.raises(FieldError) as told:
        read(tmp_path, text)
    path = str(tmp_path / "f.csv")
    assert str(told.value).startswith(f"{path}:{line}: " if line else f"{path}: ")
    assert says in str(told.value)
    assert "\n" not in str(told.value)


def collection(*features: object, **members: object) -> str:
    head = json.dumps({"type": "FeatureCollection", **members})[:-1]
    return head + ', "features": [\n' + ",\n".join(json.dumps(f) for f in features) + "\n]}"


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("{\n,", 2, "is no JSON"),
        (" ", 0, "is empty"),
        ("[" * 100_000, 0, "is no JSON that can be read"),
        ('{"type": "FeatureCollection", "features": [' + "9" * 5000 + "]}", 0, "is no JSON that can be read"),
        ("[]", 0, "give a GeoJSON FeatureCollection"),
        ('{"type": "Feature"}', 0, "holds 'Feature': give a GeoJSON FeatureCollection"),
        ('{"type": "FeatureCollection"}', 0, "features = None: give a list"),
        (collection(feature(1.0, 0.0), 3), 1, "holds 3: give a Feature"),
        (collection(feature(1.0, 0.0), feature(9.0, 0.0)), 3, "along_m = 9 m: give 0 to 4 m"),
        (collection(feature(1.0, 0.0), feature(1, 0)), 3, "is there twice, first in line 2"),
        (collection(feature(1.0, 0.0), feature(9.0, 0.0), features=[{}]), 0, "'features' is there twice"),
        (collection(feature(1.0)), 2, "1 coordinates: give 2, along_m, across_m"),
        (collection(feature(1.0, "0")), 0, ""),
        (collection(feature(1.0, None)), 2, "across_m is missing"),
        (collection(feature(1.0, True)), 2, "across_m = True is no number"),
        (collection(feature(1.0, float("nan"))), 2, "across_m = nan is no finite number"),
        (collection(feature(1.0, 10**400)), 2, "is no finite number"),
        (collection(feature(1.0, 0.0, along_m=1.0)), 2, "along_m stands in geometry and properties"),
        (collection(feature(1.0, 0.0, stages="bud")), 2, "head has no column 'stages': did you mean 'stage'?"),
        (collection(feature(1.0, 0.0, kind=["head"])), 2, "kind ['head'] is unknown"),
        (collection(feature(1.0, 0.0, kind="weather")), 2, "give null as geometry: weather have no place"),
        (collection({**feature(), "geometry": {"type": "Polygon"}}), 2, "its geometry is 'Polygon': give a Point"),
        (collection(feature(16.37, 48.21), feature(16.38, 48.21)), 2, "these look like degrees"),
        (collection(fieldgym={"task": "trays"}), 0, "is a field of 'trays'"),
        (collection(fieldgym={"task": "rows", "kinds": [["head"]]}), 0, "kind ['head'] is unknown"),
        (collection(feature(1.0, 0.0)).replace('"stage"', '"stage": "dry", "stage"'), 2, "'stage' is there twice"),
    ],
)
def test_a_geojson_that_cannot_be_read(tmp_path: Path, text: str, line: int, says: str):
    if not says:  # a number as text, as many programs export it, is understood
        assert read(tmp_path, text, "f.geojson").head.across_m.tolist() == [0.0]
        return
    with pytest.raises(FieldError) as told:
        read(tmp_path, text, "f.geojson")
    path = str(tmp_path / "f.geojson")
    assert str(told.value).startswith(f"{path}:{line}: " if line else f"{path}: ")
    assert says in str(told.value)
    assert "\n" not in str(told.value)
