"""``fieldgym field``: draw fields, check them, look at them, and make them of what other programs write."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from fieldgym.scripts.common import (
    CommandError,
    Scenario,
    Sets,
    chosen,
    environment_id,
    numbers_of,
    seeds_of,
    told_in_one_line,
    writable_folder,
)

app = typer.Typer(help="Fields in files: draw, check, show, convert.", no_args_is_help=True)

Env = Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)]
EnvOption = Annotated[str, typer.Option("--env", metavar="ID", help="An environment; see fieldgym list.")]
File = Annotated[Path, typer.Argument(metavar="FILE", help="A .csv or .geojson field.", show_default=False)]
Perception = Annotated[str | None, typer.Option(help="By default what suits the analytic backend.")]
Seed = Annotated[int, typer.Option(help="Of the environment's chance.")]
Unit = Annotated[str, typer.Option(help="Of the file's lengths: m, cm, mm or px.")]
Scale = Annotated[float | None, typer.Option(help="Metres a pixel, with --unit px.")]


@app.command()
def draw(
    env: Env,
    out: Annotated[Path, typer.Option(metavar="FILE", help="A .csv or .geojson file.")],
    scenario: Scenario = None,
    sets: Sets = None,
    seed: Seed = 0,
    perception: Perception = None,
) -> None:
    """Draw the field that an environment gets on a seed, with all of its luck, and write it.

    Try:

      fieldgym field draw SafflowerPicking --scenario pots --seed 7 --out pots-7.csv
    """
    from fieldgym.envs.field_files import write_field

    chance = _generator(seed)
    with told_in_one_line():
        field = _core(env, scenario, sets, perception).draw_field(chance)
        writable_folder(out.parent, "--out")
        write_field(field, out)
    typer.echo(f"{out}: {_counts(field)}")


@app.command()
def check(
    file: File,
    env: EnvOption,
    scenario: Scenario = None,
    sets: Sets = None,
    perception: Perception = None,
    unit: Unit = "m",
    scale: Scale = None,
    fill: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the completed field, in metres, for everybody.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Draws what the file does not say.")] = 0,
) -> None:
    """Check that a file holds a field that an environment can play; say what is in it and what was filled in.

    Try:

      fieldgym field check my-plants.csv --env LaserWeeding --unit mm --fill my-field.csv
    """
    from fieldgym.envs.field_files import read_field, write_field
    from fieldgym.envs.options import completed

    chance = _generator(seed)
    with told_in_one_line():
        core = _core(env, scenario, sets, perception)
        given = read_field(file, core.field_type, unit, scale)
        whole = completed(core, given, chance)
        typer.echo(f"{file}: {_counts(given)}")
        for line in _filled(given, whole):
            typer.echo(f"  {line}")
        if fill is not None:
            write_field(whole, fill)
            typer.echo(f"{fill}: {_counts(whole)}")


@app.command()
def show(
    file: File,
    env: EnvOption,
    out: Annotated[Path, typer.Option(metavar="PICTURE", help="A .png, .svg or .pdf file.")],
    scenario: Scenario = None,
    sets: Sets = None,
    unit: Unit = "m",
    scale: Scale = None,
) -> None:
    """Draw a picture of a field, with the machine's window dashed and what lies outside ringed.

    Try:

      fieldgym field show pots-7.csv --env SafflowerPicking --scenario pots --out pots-7.png
    """
    from fieldgym.envs.field_files import read_field
    from fieldgym.envs.field_picture import picture

    with told_in_one_line():
        core = _core(env, scenario, sets, None)
        field = read_field(file, core.field_type, unit, scale)
        try:
            picture(field, out, file.name, core.window)
        except ImportError:
            raise CommandError('pictures need matplotlib: pip install "fieldgym[bench]"') from None
        except OSError as error:
            raise CommandError(f"{out}: cannot be written ({error.strerror or error})") from None
    typer.echo(str(out))


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="What another program wrote.", show_default=False)],
    form: Annotated[str, typer.Option("--from", metavar="FORM", help="cropandweed, coco or geojson.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="A .csv or .geojson file.")],
    env: EnvOption = "LaserWeeding",
    scenario: Scenario = None,
    sets: Sets = None,
    scale: Annotated[float | None, typer.Option(help="Metres a pixel.")] = None,
    heading: Annotated[str, typer.Option(help="Where the machine drives in the picture: x, right, or y, up.")] = "x",
    image: Annotated[str | None, typer.Option(help="Name or id of the picture, where a COCO file has many.")] = None,
    species: Annotated[
        list[str] | None,
        typer.Option(
            "--map", metavar="NAME=CLASS", help="A species is crop, broadleaf, grass or left-out; may be repeated."
        ),
    ] = None,
) -> None:
    """Make a strip of field of plants marked in pictures, or of points; what lies outside the strip is left out.

    Try:

      fieldgym field convert ave-0001-0001.csv --from cropandweed --scale 0.0004 --out strip.csv
    """
    from fieldgym.envs.field_files import write_field
    from fieldgym.envs.weeding.field import WeedField
    from fieldgym.envs.weeding.readers import read_plants, weed_field

    with told_in_one_line():
        core = _core(env, scenario, sets, None)
        if core.field_type is not WeedField:
            raise CommandError(f"--env {env}: weeds and crop plants are converted, choose an environment that weeds")
        classes = {name: str(value) for name, value in numbers_of(species or (), "--map").items()}
        plants = read_plants(source, form, scale, classes, heading, image)
        field = weed_field(plants, core.window)
        if not len(field.weeds):
            raise CommandError(f"{source}: none of its {len(plants)} plants is a weed in the strip: mind the scale")
        core.complete(field, _generator(0))
        write_field(field, out)
    left = len(plants) - len(field.weeds) - len(field.crops or ())
    typer.echo(f"{out}: {_counts(field)}" + (f"; {left} plants outside the strip are left out" if left else ""))


@app.command()
def columns(
    env: Env, as_markdown: Annotated[bool, typer.Option("--markdown", help="As Markdown, for pages.")] = False
) -> None:
    """Print what a field's file holds: its kinds of rows, and of each column unit, range and meaning.

    Try:

      fieldgym field columns LaserWeeding
    """
    from fieldgym.envs.field_schema import column_lines, markdown, summary

    with told_in_one_line():
        field_type = _core(env, None, None, None).field_type
    if as_markdown:
        typer.echo(markdown(field_type), nl=False)
        return
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    for kind in field_type.kinds():
        main = " Rows of a file without a column 'kind' are of this kind." if kind == field_type.main else ""
        table = Table("column", "unit", "values", "if missing", "meaning", title_justify="left")
        for line in column_lines(field_type):
            if line.kind == kind:
                table.add_row(line.name, line.unit, line.values, line.if_missing or "must be given", line.doc)
        console.print(f"[bold]{kind}[/bold]  {summary(kind, field_type)}{main}".rstrip())
        console.print(table)


def _core(env: str, scenario: str | None, sets: list[str] | None, perception: str | None) -> Any:
    """The rules of an environment, one world."""
    from fieldgym.envs import task

    parts = task(environment_id(env)).assembly
    level = chosen(perception or parts.default_perception("analytic"), parts.perceptions, "perception")
    config = parts.configured(scenario, overrides=numbers_of(sets or ()))
    return parts.core(config, parts.perception_model(level, config), 1)


def _generator(seed: int) -> Any:
    from gymnasium.utils import seeding

    return seeding.np_random(seeds_of(seed, None, None, 1)[0])[0]


def _counts(field: Any) -> str:
    return ", ".join(f"{len(table)} {kind}" for kind, table in field.tables())


def _filled(given: Any, whole: Any) -> Iterator[str]:
    """What a completed field has and the given one had not, line by line."""
    for kind, table in whole.tables():
        before = getattr(given, kind)
        if before is None or len(before) != len(table):
            had = "none" if before is None else str(len(before))
            yield f"{kind}: {len(table)} rows, {had} given"
            continue
        for name, column in table.columns().items():
            filled = column.missing(getattr(before, name)) & ~column.missing(getattr(table, name))
            if filled.any():
                yield f"{kind}: {name} filled in {int(filled.sum())} of {len(table)} rows"
