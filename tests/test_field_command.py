"""``fieldgym field`` as a person meets it, and the tables that a declaration gives."""

from pathlib import Path

import gymnasium as gym
import pytest
from typer.testing import CliRunner

from fieldgym.envs import env_ids, task
from fieldgym.envs.field import Field, FieldError
from fieldgym.envs.field_files import read_field
from fieldgym.envs.field_schema import column_lines, markdown
from fieldgym.scripts.common import CommandError
from fieldgym.scripts.field import app

ENV = "fieldgym/SafflowerPicking-v0"
HAND = "along_m,across_m,up_m,stage\n0.1,0.0,0.8,fresh\n0.2,0.05,0.8,late\n"


def field(*words: object) -> str:
    """What a command prints."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception is not None:
        raise done.exception
    return done.output


def field_type(env_id: str) -> type[Field]:
    parts = task(env_id).assembly
    return parts.core(parts.configured(), parts.perception_model("perfect", parts.configured()), 1).field_type


def test_draw_writes_the_field_of_a_seed(tmp_path: Path):
    path = tmp_path / "made" / "pots.csv"
    said = field("draw", ENV, "--scenario", "pots", "--seed", 7, "--perception", "perfect", "--out", path)
    assert said == f"{path}: 40 heads, 15 plants, 40 reports, 1 camera\n"
    env = gym.make(ENV, scenario="pots", backend="analytic", perception="perfect").unwrapped
    env.reset(seed=7)
    assert read_field(path, field_type(ENV)) == env.field  # type: ignore[attr-defined]


def test_check_says_what_was_filled_and_writes_the_completed_field(tmp_path: Path):
    path, whole = tmp_path / "hand.csv", tmp_path / "whole.geojson"
    path.write_text(HAND)
    said = field("check", path, "--env", ENV, "--scenario", "pots", "--fill", whole).splitlines()
    assert said[0] == f"{path}: 2 heads"
    assert "  heads: mass_g filled in 2 of 2 rows" in said
    assert "  plants: 15 rows, none given" in said
    assert said[-1].startswith(f"{whole}: 2 heads, 15 plants")
    assert len(field("check", whole, "--env", ENV, "--scenario", "pots").splitlines()) == 1


@pytest.mark.parametrize("name", ["hand.csv", "hand.geojson"])
def test_what_does_not_fit_the_machine_is_told_with_its_line(tmp_path: Path, name: str):
    path = tmp_path / name
    if name.endswith("csv"):
        path.write_text(HAND + "60,0,0.8,bud\n")
    else:
        point = '{"type": "Feature", "geometry": {"type": "Point", "coordinates": [%s, 0, 0.8]}, '
        point += '"properties": {"stage": "bud"}}'
        path.write_text(f'{{"type": "FeatureCollection", "features": [\n{point % 0.1},\n\n{point % 60}]}}')
    with pytest.raises(CommandError) as told:
        field("check", path, "--env", ENV, "--scenario", "pots")
    assert str(told.value).startswith(f"{path}:4: heads: along_m = 60 m: outside the row, give")
    assert "is the file in" not in str(told.value)
    env = gym.make(ENV, scenario="pots", backend="analytic").unwrapped
    with pytest.raises(FieldError) as refused:
        env.reset(options={"field": path})
    assert str(refused.value) == str(told.value)
    path.write_text(path.read_text().replace("60", "1180"))
    with pytest.raises(CommandError, match=r"give -0.415 to 6.715 m \(is the file in mm\? then read it with that unit"):
        field("check", path, "--env", ENV, "--scenario", "pots")


def test_show_writes_a_picture_even_of_what_lies_outside(tmp_path: Path):
    pytest.importorskip("matplotlib")
    path, picture = tmp_path / "hand.csv", tmp_path / "hand.png"
    path.write_text(HAND + "99,0,0.8,bud\n")
    field("show", path, "--env", ENV, "--out", picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(CommandError, match="cannot be written"):
        field("show", path, "--env", ENV, "--out", tmp_path / "no" / "hand.png")
    with pytest.raises(CommandError, match="'xls' is not supported"):
        field("show", path, "--env", ENV, "--out", tmp_path / "hand.xls")


def test_mistakes_are_told_in_one_line(tmp_path: Path):
    path = tmp_path / "hand.csv"
    path.write_text(HAND)
    for words, says in (
        (("check", tmp_path / "no.csv", "--env", ENV), "there is no such file"),
        (("check", path, "--env", ENV, "--unit", "inch"), "unit = 'inch' is unknown: choose one of 'm'"),
        (("check", path, "--env", ENV, "--unit", "px"), "scale = None: with unit = 'px' give the metres a pixel"),
        (("check", path, "--env", ENV, "--scale", "0.001"), "it goes with unit = 'px'"),
        (("check", path, "--env", ENV, "--seed", "-1"), "--seed -1: give 0 or more"),
        (("check", path, "--env", ENV, "--scenario", "pods"), "did you mean 'pots'"),
        (("draw", ENV, "--out", tmp_path / "field.xlsx"), "give one of these endings"),
        (("draw", ENV, "--out", path / "field.csv"), "cannot make the folder"),
        (("draw", ENV, "--perception", "eyes", "--out", path), "no perception is called 'eyes'"),
    ):
        with pytest.raises(CommandError) as told:
            field(*words)
        assert says in str(told.value), words
        assert str(told.value).isprintable()
    assert path.read_text() == HAND


def test_columns_are_printed_as_declared():
    said = field("columns", ENV, "--markdown")
    assert said == markdown(field_type(ENV))
    assert "Rows of a file without a column 'kind' are of this kind." in " ".join(field("columns", ENV).split())


def test_a_declaration_as_a_table():
    lines = {(line.kind, line.name): line for line in column_lines(field_type(ENV))}
    assert lines["heads", "along_m"].if_missing == ""
    assert lines["heads", "along_m"].unit == "m"
    assert lines["heads", "stage"].values == "bud, fresh, late, dry"
    assert lines["heads", "occluded"][3:5] == ("0, 1", "0")
    assert lines["heads", "cut_luck"].if_missing == "drawn, normal"
    assert lines["heads", "mass_g"].if_missing == "the task's choice"


@pytest.mark.parametrize("env_id", env_ids())
def test_the_page_has_the_tables_of_the_declaration(env_id: str):
    page = Path(__file__).resolve().parents[1] / "docs" / "fields.md"
    assert markdown(field_type(env_id)) in page.read_text()
