"""Plants from other programs' files: places, species and stages, and what cannot be read in one line."""

import json
from pathlib import Path

import gymnasium as gym
import pytest
from typer.testing import CliRunner

from fieldgym.envs.field import ABSENT, FieldError
from fieldgym.envs.weeding.readers import Found, read_plants, weed_field
from fieldgym.scripts.field import app

SCALE = 0.0005


def write(folder: Path, text: object, name: str = "plants") -> Path:
    path = folder / name
    path.write_text(text if isinstance(text, str) else json.dumps(text, indent=1))
    return path


def test_crop_and_weed(tmp_path: Path):
    text = "100,100,120,140,33,110,144\n200,500,300,560,31,250,544\n\n0,0,200,200,7,1000,600\n5,5,6,6,255,5,5\n"
    path = write(tmp_path, text)
    found = read_plants(path, "cropandweed", SCALE)
    assert [(plant.what, plant.stage, plant.line) for plant in found] == [
        ("broadleaf", "cotyledon", 1),
        ("grass", "two-leaf", 2),
        ("crop", "", 4),
    ]
    assert [plant.along_m for plant in found] == pytest.approx([0.055, 0.125, 0.5])
    assert [plant.across_m for plant in found] == pytest.approx([0.2, 0.0, -0.028])
    assert (
        read_plants(write(tmp_path, "Left,Top,Right,Bottom,LabelID,StemX,StemY\n" + text), "cropandweed", SCALE)[0][:-1]
        == (found[0][:-1])
    )


def test_the_machine_may_drive_up_the_picture(tmp_path: Path):
    path = write(tmp_path, "0,0,1,1,33,960,1088\n0,0,1,1,33,0,0\n")
    found = read_plants(path, "cropandweed", 0.001, heading="y")
    assert [(plant.along_m, plant.across_m) for plant in found] == [(0.0, 0.0), (1.088, 0.96)]


def test_species_can_be_mapped(tmp_path: Path):
    path = write(tmp_path, "0,0,1,1,33,0,0\n0,0,1,1,7,0,0\n0,0,1,1,255,0,0\n")
    mapping = {"33": "crop", "7": "left-out", "255": "grass"}
    assert [plant.what for plant in read_plants(path, "cropandweed", SCALE, mapping)] == ["crop", "grass"]


def coco(**changes: object) -> dict[str, object]:
    """Two pictures; in the first three weeds, a crop plant and a box of nothing."""
    names = ("weed: lolium rigidum", "weed (seedling)", "crop: triticum aestivum", "none", "weed: UNSPECIFIED")
    annotations = [
        {"id": 1, "image_id": 0, "category_id": 0, "bbox": [10, 20, 140, 40]},
        {"id": 2, "image_id": 0, "category_id": 1, "bbox": [0, 0, 60, 100], "keypoints": [0, 0, 0, 44, 55, 2]},
        {"id": 3, "image_id": 0, "category_id": 2, "bbox": [0, 0, 10, 10]},
        {"id": 4, "image_id": 0, "category_id": 3, "bbox": [0, 0, 10, 10]},
        {"id": 5, "image_id": 0, "category_id": 4, "keypoints": [200, 50, 1]},
        {"id": 6, "image_id": 7, "category_id": 0, "bbox": [0, 0, 1, 1]},
    ]
    return {
        "images": [{"id": i, "file_name": f"{i}.jpg", "width": 200, "height": 100} for i in (0, 7)],
        "categories": [{"id": i, "name": name} for i, name in enumerate(names)],
        "annotations": annotations,
        **changes,
    }


def test_coco(tmp_path: Path):
    text = json.dumps(coco(), indent=1)
    found = read_plants(write(tmp_path, text), "coco", SCALE, image="0.jpg")
    assert [(plant.what, plant.stage) for plant in found] == [
        ("grass", "four-leaf"),
        ("broadleaf", "four-leaf"),
        ("crop", ""),
        ("broadleaf", ""),
    ]
    assert [plant.along_m for plant in found] == pytest.approx([0.04, 0.022, 0.0025, 0.1])
    assert [plant.across_m for plant in found] == pytest.approx([0.005, -0.0025, 0.0225, 0.0])
    assert '"id": 2,' in text.splitlines()[found[1].line]
    assert len(read_plants(tmp_path / "plants", "coco", SCALE, image="7")) == 1


def test_geojson(tmp_path: Path):
    def feature(name: str, *place: float, **more: str) -> dict[str, object]:
        geometry = {"type": "Point", "coordinates": place}
        return {"type": "Feature", "geometry": geometry, "properties": {"species": name, **more}}

    features = [
        feature("Chenopodium album", 0.1, 0.02, stage="two-leaf"),
        feature("Poa annua", 0.2, -0.02),
        feature("crop", 0.3, 0.0),
        feature("Beta vulgaris", 0.4, 0.0),
    ]
    path = write(tmp_path, {"type": "FeatureCollection", "features": features})
    assert read_plants(path, "geojson", species={"beta": "crop"}) == [
        Found("broadleaf", 0.1, 0.02, "two-leaf", 4),
        Found("grass", 0.2, -0.02, "", 18),
        Found("crop", 0.3, 0.0, "", 31),
        Found("crop", 0.4, 0.0, "", 44),
    ]
    with pytest.raises(
        FieldError, match=r"plants:44: species 'Beta vulgaris' is unknown: map it to one of crop, broad"
    ):
        read_plants(path, "geojson")


@pytest.mark.parametrize(
    ("form", "text", "says"),
    [
        ("cropandweed", "1,2,3,4,33,5\n", ":1: has 6 cells: give Left,Top"),
        ("cropandweed", "1,2,3,4,33,5,x\n", ":1: StemY = 'x' is no finite number"),
        ("cropandweed", "1,2,3,4,33,5,nan\n", ":1: StemY = nan is no finite number"),
        ("cropandweed", "\n1,2,3,4,133,5,6\n", ":2: LabelID 133 is unknown: known are 1 to 99 and 255"),
        ("coco", "{}", ": images = None: give a COCO file"),
        ("coco", "[1,", ":1: is no JSON"),
        ("coco", coco(), ": has 2 images: name one, such as '0.jpg', '7.jpg'"),
        ("coco", coco(images=[{"id": 0}]), ": width of its picture = None is no finite number"),
        ("coco", coco(images=coco()["images"][:1], categories=[]), ": category 0 has no name"),  # type: ignore[index]
        ("geojson", "{}", ": holds None: give a GeoJSON FeatureCollection"),
        ("kml", "", "form = 'kml' is unknown: choose one of 'cropandweed', 'coco', 'geojson'"),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, form: str, text: object, says: str):
    with pytest.raises(FieldError) as told:
        read_plants(write(tmp_path, text), form, None if form == "geojson" else SCALE)
    assert says in str(told.value)
    assert str(told.value).isprintable()


def test_a_picture_needs_its_scale_and_a_known_class(tmp_path: Path):
    path = write(tmp_path, "1,2,3,4,33,5,6\n")
    with pytest.raises(FieldError, match="give the metres a pixel"):
        read_plants(path, "cropandweed")
    with pytest.raises(FieldError, match="species '33' cannot be 'gras': did you mean 'grass'"):
        read_plants(path, "cropandweed", SCALE, {"33": "gras"})
    with pytest.raises(FieldError, match="heading = 'z' is unknown"):
        read_plants(path, "cropandweed", SCALE, heading="z")


def test_plants_become_a_strip(tmp_path: Path):
    found = [
        Found("grass", 0.2, 0.01, "", 1),
        Found("crop", 0.1, 0.0, "", 2),
        Found("broadleaf", 0.3, -0.01, "two-leaf", 3),
        Found("broadleaf", 0.31, -0.02, "four-leaf", 4),
        Found("crop", 0.32, 0.0, "", 5),
    ]
    field = weed_field(found, {"along_m": (0.0, 0.3), "across_m": (-0.01, 0.01)})
    assert field.weeds.along_m.tolist() == [0.2, 0.3]
    assert field.weeds.across_m.tolist() == [0.01, -0.01]
    assert field.weeds.species.tolist() == [1, 0]
    assert field.weeds.stage.tolist() == [ABSENT, 1]
    assert field.crops is not None
    assert field.crops.along_m.tolist() == [0.1]
    assert len(weed_field(found).weeds) == 3


def test_the_command_makes_a_strip_that_can_be_played(tmp_path: Path):
    source, path = tmp_path / "picture.csv", tmp_path / "strip.csv"
    source.write_text("0,0,40,40,33,1000,544\n0,0,9,9,7,1200,600\n0,0,9,9,41,1919,1087\n")
    words = ["convert", str(source), "--from", "cropandweed", "--scale", "0.0005", "--out", str(path)]
    done = CliRunner().invoke(app, [*words, "--set", "scenario.strip_m=0.9"])
    assert done.output == f"{path}: 1 weeds, 1 crops; 1 plants outside the strip are left out\n"
    env = gym.make("fieldgym/LaserWeeding-v0", backend="analytic", overrides={"scenario.strip_m": 0.9})
    env.reset(seed=1, options={"field": path})
    field = env.unwrapped.field  # type: ignore[attr-defined]
    assert (field.weeds.along_m.tolist(), field.weeds.across_m.tolist()) == ([0.5], [0.0])
    done = CliRunner().invoke(app, [*words, "--map", "41=tree"])
    assert "species '41' cannot be 'tree'" in str(done.exception)
    done = CliRunner().invoke(app, [*words, "--map", "33=crop", "--map", "41=left-out"])
    assert "none of its 2 plants is a weed in the strip" in str(done.exception)
    done = CliRunner().invoke(app, [*words, "--env", "ProduceSorting"])
    assert "choose an environment that weeds" in str(done.exception)
