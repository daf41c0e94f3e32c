"""`palpate view`: a live page of an episode as it runs, or of touches as you make them."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Annotated

import typer

from .own_parts import Edges, Outliers, PlaneHeight, PositionError, Resting, Units, metres

if TYPE_CHECKING:
    from rich.console import Console

    from ..page.story import Story

__all__ = ["view"]


def view(
    contacts: Annotated[
        Path | None,
        typer.Option(
            metavar="CONTACTS.csv",
            help="Show these touches, and each line that is added (columns as of `palpate"
            " recognize`). [dim]default: an episode in simulation[/]",
            show_default=False,
        ),
    ] = None,
    library: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="A folder of closed meshes (OBJ, OFF, PLY or STL). [dim]default, in an episode:"
            " the library that comes with palpate[/]",
            show_default=False,
        ),
    ] = None,
    units: Units = "mm",
    position_error: PositionError = None,
    normal_error_deg: Annotated[
        float | None,
        typer.Option(
            metavar="A",
            help="Each normal is within this of the truth, degrees. [dim]default: 15, in an"
            " episode 18[/]",
            show_default=False,
        ),
    ] = None,
    plane: PlaneHeight = None,
    resting: Resting = False,
    outliers: Outliers = 0,
    edges: Edges = False,
    object_name: Annotated[
        str | None,
        typer.Option(
            "--object",
            metavar="NAME",
            help="In an episode: what is touched. [dim]default: drawn by the seed[/]",
            show_default=False,
        ),
    ] = None,
    sensor: Annotated[
        str,
        typer.Option(metavar="NAME", help="In an episode: ray, ball, finger, range, range-grid."),
    ] = "ray",
    policy: Annotated[
        str, typer.Option(metavar="NAME", help="In an episode: the strategy.")
    ] = "random",
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="In an episode: same seed, same episode.")
    ] = 45,
    max_probes: Annotated[
        int, typer.Option(metavar="N", min=1, help="In an episode: give up after so many probes.")
    ] = 40,
    pause: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="In an episode: seconds between probes.")
    ] = 2.0,
    port: Annotated[
        int, typer.Option(metavar="N", min=0, max=65535, help="Of the page; 0 for any.")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Say where the page is, but don't open it.")
    ] = False,
) -> None:
    """Look on in a browser, while an episode runs or while you touch.

    With --contacts and --library the file is watched: add a line for each touch, and the page
    shows what could still be true. Without, an episode is played. The page is for this machine
    alone, and is there until Ctrl-C.
    """
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    if contacts is None:
        from ...envs.probe_env import ProbeEnv
        from ...policies import make_policy
        from ...recognizer import load_folder
        from ..benchmark.playing import task_of
        from ..page.story_episode import episode_stories

        scale = metres(units)
        env = ProbeEnv(
            None if library is None else load_folder(library, scale=scale),
            object_name=object_name,
            sensor=sensor,
            position_error=0.000254 if position_error is None else position_error * scale,
            normal_error=radians(18.0 if normal_error_deg is None else normal_error_deg),
            max_probes=max_probes,
        )
        stories = episode_stories(env, make_policy(policy, task_of(env)), seed)
        _show(_paced(stories, pause), port, no_browser, console)
        return
    if library is None:
        raise ValueError("--contacts needs --library, the folder of the parts it could be of")
    from .watching import Watched, watched_stories

    watched = Watched(
        path=contacts,
        library=library,
        units=units,
        position_error=position_error,
        normal_error_deg=15.0 if normal_error_deg is None else normal_error_deg,
        plane=plane,
        resting=resting,
        outliers=outliers,
        edges=edges,
    )
    _show(watched_stories(watched, console.print), port, no_browser, console)


def _paced(stories: Iterator[Story], pause: float) -> Iterator[Story]:
    """The same with a pause after each, seconds."""
    for story in stories:
        yield story
        sleep(pause)


def _show(stories: Iterator[Story], port: int, no_browser: bool, console: Console) -> None:
    """Serve stories, each as it comes, until Ctrl-C."""
    import webbrowser

    from ..page.live_page import LivePage, serve

    live = LivePage.of(next(stories))
    with serve(live, port) as address:
        console.print(f"{address}  (this machine alone; Ctrl-C ends it)")
        if not no_browser:
            webbrowser.open(address)
        try:
            for story in stories:
                live.tell(story)
                console.print(_line(story))
            while True:
                sleep(3600.0)
        except KeyboardInterrupt:
            console.print()


def _line(story: Story) -> str:
    """What a story has come to, in a line."""
    from collections import Counter

    last = story.moments[-1]
    if last.belief is None:
        return f"{last.title}: {last.told}"
    counts = Counter(one.object_name for one in last.belief.hypotheses).most_common(3)
    named = ", ".join(f"{name} {many}" for name, many in counts)
    left = len(last.belief.hypotheses)
    return f"{last.title}: {left} left" + (f" ({named})" if named else ", not in this library")
