"""`gfmd init` and `gfmd surface`: from a scan to a spec."""

import json
from pathlib import Path

import click

from gfmd_cli.cli.messages import print_data, print_error, print_text
from gfmd_cli.cli.options import FILE, Command, overrides_option
from gfmd_cli.errors import InputError, typed


@click.command(cls=Command)
@click.argument("spec", type=FILE, default="study.toml")
@click.option("--from", "scan", type=FILE, metavar="SCAN", help="Measured height map to use.")
@overrides_option
def init(spec: Path, scan: Path | None, overrides: tuple[str, ...]) -> None:
    """Write a commented run spec, by default study.toml.

    Without --from the spec describes a random surface and runs in seconds. With --from it
    describes a measured surface: a .npy or HDF5 array, or a microscope file. --set sets any key of
    the spec. Examples:

    \b
        gfmd init contact.toml --from scan.di
        gfmd init contact.toml --from nm.npy --set surface.scale=1e-9 --set surface.length=1e-5
        gfmd init steel.toml --from scan.di --set elastomer.E_star=70e9 --set "load.pressure=[1e8]"
    """
    from gfmd_cli.files.atomic import exists, target_of, write_whole
    from gfmd_cli.spec.parse import read_scan
    from gfmd_cli.spec.starter import starter, starter_of_scan

    if exists(spec):
        raise InputError(f"{spec}: the file exists; choose another name or remove it")
    if scan is None:
        text = starter(spec, overrides)
    else:
        of_surface = tuple(word for word in overrides if word.startswith(("surface.", "surface=")))
        surface = read_scan(scan, of_surface)
        text, preparation, warnings = starter_of_scan(spec, surface, overrides)
        print_text(preparation)
        for warning in warnings:
            print_error(f"gfmd: {scan}: {warning}")
    try:
        content = text.encode()
    except UnicodeEncodeError as error:
        message = f"{scan or spec}: the name is not UTF-8, as all of a spec is; rename the file"
        raise InputError(message) from error
    write_whole(target_of(spec), content)
    print_text(f"{spec}: written\nnext: gfmd run {typed(spec)}")


@click.command(cls=Command)
@click.argument("paths", metavar="SPEC|SCAN...", type=FILE, nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print a list of records in SI units.")
@click.option("--figure", type=FILE, metavar="OUT", help="Write a figure: OUT.png, .pdf or .svg.")
@overrides_option
def surface(
    paths: tuple[Path, ...], as_json: bool, figure: Path | None, overrides: tuple[str, ...]
) -> None:
    """Print size, roughness and fitted spectrum of surfaces.

    The parameters are those of ISO 25178 (Sq, Sa, Ssk, Sku, Sz, Sdq, Sdr, Sal), for a line profile
    those of ISO 21920. For one surface, a self-affine spectrum is fitted and also printed as a
    table [surface] for a run spec. For several surfaces, the results are one table. The
    power spectrum C(q) is part of --json and --figure. A scan is read and prepared as by `gfmd init
    --from`. Examples:

    \b
        gfmd surface scan.di --figure scan.png
        gfmd surface worn.npy new.npy --set surface.scale=1e-9 --set surface.periodic=false
    """
    from gfmd_cli.analysis.surface_summary import summarise, summary_table, summary_text
    from gfmd_cli.spec.parse import read_scan, read_spec

    if figure is not None:
        from gfmd_cli.analysis.plotting import check_figure

        check_figure(figure)
    names, summaries = [], []
    for path in paths:
        if path.suffix == ".toml":
            spec = read_spec(path, overrides)[0]
            given = [0 if grid.points == "auto" else grid.points for grid in spec.grid]
            points, grid = max(given), spec.grid[given.index(max(given))]
            surfaces = [grid.on_cell(each, points)[0] for each in spec.surface]
            names += [each.label for each in surfaces]
            summaries += [summarise(each, points) for each in surfaces]
        else:
            names.append(str(path))
            summaries.append(summarise(read_scan(path, overrides)))
    if as_json:
        print_data(json.dumps([summary.record() for summary in summaries], indent=1) + "\n")
    elif len(summaries) == 1:
        print_text(summary_text(summaries[0]))
    else:
        print_text(summary_table(summaries, names).as_text())
        for summary, name in zip(summaries, names, strict=True):
            for warning in summary.warnings():
                print_error(f"gfmd: {name}: {warning}")
    if figure is not None:
        from gfmd_cli.analysis.plotting import styled
        from gfmd_cli.analysis.surface_figure import summary_figure

        with styled():
            summary_figure(summaries, names).write_file(figure)
        print_error(str(figure))
