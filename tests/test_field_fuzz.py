"""Files of fields, damaged at random: a valid field or an error of one line, and nothing else."""

import random
from pathlib import Path

import numpy as np
import pytest

from fieldgym.envs import env_ids, task
from fieldgym.envs.field import Field, FieldError
from fieldgym.envs.field_files import read_field, write_field

TOKENS = (
    *(
        "",
        "nan",
        "NaN",
        "inf",
        "-inf",
        "1e999",
        "-1",
        "1180",
        "0",
        "1.5",
        "1_0",
        "0x1",
        "\u0661",
        "null",
        "true",
        "yes",
        "1,5",
    ),
    *("kind", "along", "across_m", "Point", "Polygon", "features", "open", "9" * 400, "9" * 5000, "-" * 300),
    *(";", "\t", '"', "'", "\\", "#", "{", "}", "[", "]" * 3, "[" * 2000, "\r", "\n", "\r\n", "\x00", "\x0b", "\u2028"),
    *("\ud83c", "\ufeff", "é", "🍓", '{"type": "Feature"}', '"geometry": null', '"coordinates": []', '"properties": 3'),
)


def damaged(text: str, dice: random.Random) -> bytes:
    """A text with one to three faults."""
    for _ in range(dice.randint(1, 3)):
        at = dice.randrange(len(text) + 1)
        way = dice.randrange(7)
        if way == 0:  # a token in place of some letters
            text = text[:at] + dice.choice(TOKENS) + text[at + dice.randrange(12) :]
        elif way == 1:  # a cell or a value
            parts = text.split(",")
            parts[dice.randrange(len(parts))] = dice.choice(TOKENS)
            text = ",".join(parts)
        elif way == 2:  # lines lost, doubled or out of order
            lines = text.split("\n")
            one, other = dice.randrange(len(lines)), dice.randrange(len(lines))
            lines[one : one + dice.randrange(3)] = [lines[other]] * dice.randrange(3)
            text = "\n".join(lines)
        elif way == 3:  # cut off
            text = text[:at]
        elif way == 4:  # a word for another
            words = text.replace('"', ",").replace(" ", ",").split(",")
            text = text.replace(dice.choice(words) or "0", dice.choice(words), dice.choice((1, -1)))
        elif way == 5:  # a letter for another
            text = text[:at] + chr(dice.randrange(256)) + text[at + 1 :]
        else:  # a part twice
            text = text[:at] + text[at : at + dice.randrange(60)] + text[at:]
    data = text.encode("utf-8", "surrogatepass")
    if dice.random() < 0.1 and data:
        at = dice.randrange(len(data))
        data = data[:at] + bytes([dice.randrange(256)]) + data[at + 1 :]
    return data


def short(field: Field, rows: int = 3) -> Field:
    """A field with few rows of each kind, so that most of a file is its frame."""
    return type(field)(**{k: type(t)(**{n: v[:rows] for n, v in t.arrays().items()}) for k, t in field.tables()})


def sources(folder: Path, seeds: int) -> list[tuple[type[Field], str, str]]:
    """Types, endings and texts of drawn fields of every task, short ones first, then whole ones."""
    found = []
    assemblies = [task(env_id).assembly for env_id in env_ids()]
    for seed in range(seeds):
        for parts in assemblies:
            config = parts.configured()
            core = parts.core(config, parts.perception_model(parts.default_perception("analytic"), config), 1)
            field = core.draw_field(np.random.default_rng(seed))
            for ending in (".csv", ".geojson"):
                path = folder / f"whole{ending}"
                write_field(field if seed else short(field), path)
                found.append((type(field), ending, path.read_text()))
    return found


def check(folder: Path, files: int, seeds: int) -> tuple[int, int]:
    """Read damaged files; returns how many were refused and how many made a field."""
    texts, dice, refused, made = sources(folder, seeds), random.Random(1), 0, 0
    some = texts[: len(texts) // seeds]
    for _ in range(files):
        # Most of a whole field are rows like others, and reading it takes three times as long.
        field_type, ending, text = dice.choice(texts if dice.random() < 0.2 else some)
        path = folder / f"f{ending if dice.random() < 0.98 else '.txt'}"
        path.write_bytes(damaged(text, dice))
        try:
            field = read_field(path, field_type)
        except FieldError as error:
            told = str(error)
            assert told.isprintable(), told
            assert len(told) < 1000, told
            refused += 1
        else:
            field.check()
            if made % 20 == 0:
                write_field(field, folder / f"again{ending}")
                assert read_field(folder / f"again{ending}", field_type) == field
            made += 1
    return refused, made


def test_damaged_files_are_refused_in_one_line_or_are_fields(tmp_path: Path):
    refused, made = check(tmp_path, files=2000, seeds=1)
    assert refused > 500
    assert made > 50


@pytest.mark.slow
@pytest.mark.long
def test_many_damaged_files_are_refused_in_one_line_or_are_fields(tmp_path: Path):
    refused, made = check(tmp_path, files=100_000, seeds=2)
    assert refused > 30_000
    assert made > 3_000
