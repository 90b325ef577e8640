"""The command line: arguments only; what the commands do is in `sssslam.commands`."""

import os
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from sssslam import __version__

app = typer.Typer(
    name="sssslam",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Side-scan sonar submap SLAM: a recording goes in, a corrected track, a map and a report come out.",
)

Recordings = Annotated[list[Path], typer.Argument(help="Recordings; several files make one dive.", show_default=False)]
OneRecording = Annotated[Path, typer.Argument(help="A recording.", show_default=False)]
Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for the products.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="TOML file; see `sssslam config`.")]
Settings = Annotated[list[str] | None, typer.Option("-s", "--set", help="section.key=value; may be repeated.")]
Channels = Annotated[str | None, typer.Option(help="Which channels of a dual-frequency file, such as 3,4 or 900kHz.")]
MethodName = Annotated[str | None, typer.Option(help="Method of reconstruction; same as -s reconstruction.method=.")]
Together = Annotated[
    bool,
    typer.Option(
        "--together", help="Reconstruct the map of all passes over a place together; same as -s map.method=together."
    ),
]
Nav = Annotated[Path | None, typer.Option("--nav", help="Navigation beside the sonar: CSV with a header, TUM or NMEA.")]
ClockOffset = Annotated[
    str | None, typer.Option(help="Seconds to add to the times of --nav, or 'estimate'.", metavar="SECONDS|estimate")
]
Closures = Annotated[
    Path | None,
    typer.Option(
        help="Loop closures to accept or reject: CSV target,source,decision; a copy of loop_closures.csv will do."
    ),
]
Positions = Annotated[
    Literal["recorded", "dead-reckoned"],
    typer.Option(
        "--navigation",
        help="Positions as recorded, or rebuilt from heading and speed with the recorded ones as reference.",
    ),
]
Seed = Annotated[int | None, typer.Option(help="Seed of the scene.", min=0)]


def _mapped(together: bool) -> list[str]:
    return ["map.method=together"] if together else []


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"sssslam {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Version.")] = False,
) -> None:
    pass


@app.command()
def demo(out: Out = Path("out/demo"), seed: Seed = None, config: ConfigFile = None, settings: Settings = None) -> None:
    """Examples:

    \b
      sssslam demo                  simulate a survey, correct its track, evaluate, write out/demo/report.html
      sssslam demo --seed 7 -o out/seven

    Simulate a survey that sees places again from several headings, run on it, and compare with the truth.
    """
    from sssslam import commands

    commands.demo(out, seed, commands.configuration(config, settings))


@app.command()
def run(
    recordings: Recordings,
    out: Out,
    config: ConfigFile = None,
    settings: Settings = None,
    channels: Channels = None,
    nav: Nav = None,
    clock_offset: ClockOffset = None,
    navigation: Positions = "recorded",
    closures: Closures = None,
    together: Together = False,
) -> None:
    """Examples:

    \b
      sssslam run dive.xtf -o out
      sssslam run part1.xtf part2.xtf -o out -s windows.length=80
      sssslam run dive.nc -o out --config my.toml
      sssslam run dive.xtf -o out --nav track.csv --clock-offset estimate
      sssslam run boat.logdoc -o out --navigation dead-reckoned
      sssslam run dive.xtf -o again --closures decisions.csv
      sssslam run dive.xtf -o out --together

    Correct the track of a dive and write track, map, loop closures and report.
    """
    from sssslam import commands
    from sssslam.dive import Dive

    dive = Dive(recordings, channels, nav, clock_offset, navigation)
    commands.run(dive, out, commands.configuration(config, [*(settings or ()), *_mapped(together)]), closures)


@app.command()
def simulate(
    scene: Annotated[str | None, typer.Argument(help="Name of a shipped scene, or a TOML file.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write: .nc or .xtf.")] = None,
    seed: Seed = None,
    show: Annotated[bool, typer.Option("--list", help="Show the shipped scenes.")] = False,
) -> None:
    """Examples:

    \b
      sssslam simulate --list
      sssslam simulate demo -o demo.nc
      sssslam simulate my_scene.toml -o mine.nc --seed 3

    Simulate a recording with truth.
    """
    from sssslam import commands

    if show:
        commands.list_scenes()
    elif scene is None or out is None:
        raise typer.BadParameter("a scene and -o FILE are wanted, or --list")
    else:
        commands.simulate_scene(scene, out, seed)


@app.command()
def reconstruct(
    recordings: Recordings,
    out: Out,
    config: ConfigFile = None,
    settings: Settings = None,
    channels: Channels = None,
    method: MethodName = None,
    together: Together = False,
    nav: Nav = None,
    clock_offset: ClockOffset = None,
    navigation: Positions = "recorded",
) -> None:
    """Examples:

    \b
      sssslam reconstruct dive.xtf -o shape
      sssslam reconstruct dive.xtf -o shape --method joint
      sssslam reconstruct dive.xtf -o shape -s reconstruction.joint.spacing=0.5
      sssslam reconstruct dive.xtf -o shape --together

    Reconstruct the seafloor window by window, or patch by patch from all passes over it together: submaps and a figure,
    no change of the track.
    """
    from sssslam import commands
    from sssslam.dive import Dive

    chosen = [*(settings or ()), *([] if method is None else [f"reconstruction.method={method}"]), *_mapped(together)]
    dive = Dive(recordings, channels, nav, clock_offset, navigation)
    commands.reconstruct(dive, out, commands.configuration(config, chosen))


@app.command()
def evaluate(
    out: Annotated[Path, typer.Argument(help="Folder of a finished run.", show_default=False)],
    reference: Annotated[Path, typer.Option(help="Reference track: a TUM file, or a .nc with truth.")],
    terrain: Annotated[
        Path | None, typer.Option(help="True heights: a GeoTIFF, or .npz with z, spacing, origin.")
    ] = None,
) -> None:
    """Examples:

    \b
      sssslam evaluate out --reference truth.tum
      sssslam evaluate out --reference demo.nc

    Compare a run with a reference: track, loop closures and shape; adds the metrics to its report.
    """
    from sssslam import commands

    commands.evaluate(out, reference, terrain)


@app.command()
def info(
    recordings: Recordings,
    channels: Channels = None,
    figure: Annotated[Path | None, typer.Option("--figure", "-o", help="Waterfall to draw, .png.")] = None,
    nav: Nav = None,
    clock_offset: ClockOffset = None,
    navigation: Positions = "recorded",
) -> None:
    """Examples:

    \b
      sssslam info dive.xtf
      sssslam info dive.xtf --figure waterfall.png
      sssslam info dive.xtf --nav track.csv --clock-offset estimate

    Say what is in a recording and what looks wrong with it; draw its waterfall with the bottom that was found.
    """
    from sssslam import commands
    from sssslam.dive import Dive

    commands.info(Dive(recordings, channels, nav, clock_offset, navigation), figure)


@app.command()
def convert(
    recordings: Recordings,
    file: Annotated[Path, typer.Argument(help="File to write, .nc.", show_default=False)],
    channels: Channels = None,
    nav: Nav = None,
    clock_offset: ClockOffset = None,
    navigation: Positions = "recorded",
) -> None:
    """Examples:

    \b
      sssslam convert dive.xtf dive.nc
      sssslam convert dive.xtf dive.nc --nav track.tum

    Convert recordings to the open container.
    """
    from sssslam import commands
    from sssslam.dive import Dive

    commands.convert(Dive(recordings, channels, nav, clock_offset, navigation), file)


@app.command()
def view(
    out: Annotated[Path, typer.Argument(help="Folder of a finished run, or of a reconstruction.", show_default=False)],
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> None:
    """Examples:

    \b
      sssslam view out              write out/view.html and open it in the browser
      sssslam view out --no-open    write it only

    Draw seafloor, tracks and loop closures in three dimensions: one page that needs no other file and no network.
    """
    from sssslam import commands

    commands.view(out, show)


@app.command(name="config")
def show_config() -> None:
    """Examples:

    \b
      sssslam config > my.toml

    Print the default configuration, each key with its unit and reason.
    """
    from sssslam import commands

    commands.show_config()


def main() -> None:
    """Run a command; any error that a user can mend is one line on stderr and exit 1."""
    try:
        app(prog_name="sssslam")
    except KeyboardInterrupt:
        _stop("interrupted; nothing half-written is left", 130)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(141) from None
    except MemoryError:
        _stop("this machine has too little memory for that; fewer files, or a larger joint.spacing, are wanted", 1)
    except (ValueError, OSError) as error:
        if os.environ.get("SSSSLAM_DEBUG"):
            raise
        _stop(" ".join(str(error).split()), 1)


def _stop(message: str, status: int) -> None:
    print(f"sssslam: {message}", file=sys.stderr)
    raise SystemExit(status)
