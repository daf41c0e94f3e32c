"""`palpate episode`: one probing episode in simulation, told probe by probe, with a picture."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from ..page.episode_story import count, probe_line, stray_line, verdict, verdict_in_short

if TYPE_CHECKING:
    from rich.console import Console

    from ...envs.pictures.episode import Episode
    from ...envs.pictures.film_script import EpisodeRecord
    from ...envs.probe_env import ProbeEnv
    from ...policies import Policy
    from ...recognizer import Belief, Hypothesis

__all__ = ["episode"]

MOST_POSES = 4000
"""How many poses the JSON document lists of all families together, one a hypothesis at least."""
TOLD_PUSH = 1e-5
"""How far an object has to be pushed for it to be told, metres."""
MOST_GHOSTS = 2
"""More rivals than this in one picture hide each other."""


def episode(
    object_name: Annotated[
        str | None,
        typer.Option(
            "--object",
            metavar="NAME",
            help="The object to touch, from the library. [dim]default: drawn by the seed[/]",
            show_default=False,
        ),
    ] = None,
    library: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="A folder of closed meshes (OBJ, OFF, PLY or STL, metres) to tell apart. "
            "[dim]default: the library that comes with palpate[/]",
            show_default=False,
        ),
    ] = None,
    sensor: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="What touches: ray, ball, finger (a ball tip driven by dynamics), range (a"
            " scanner) or range-grid.",
        ),
    ] = "ray",
    placement: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="How the object lies: across the plane, resting on it, or dropped on it.",
        ),
    ] = "across",
    free: Annotated[
        bool,
        typer.Option("--free", help="What stands on the plane moves when the finger pushes it."),
    ] = False,
    force: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            help="The finger pushes until it feels so many newtons."
            " [dim]default: it stops at first contact[/]",
            show_default=False,
        ),
    ] = None,
    policy: Annotated[
        str, typer.Option(metavar="NAME", help="The strategy that chooses the probes.")
    ] = "random",
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Same seed, same episode, to the bit.")
    ] = 45,
    picture: Annotated[
        Path,
        typer.Option(metavar="FILE", help="Where to draw the end of the episode, as a PNG."),
    ] = Path("episode.png"),
    video: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mp4",
            help="Film the episode: the finger at work, contacts as they come, rivals fading. "
            "[dim]default: no film[/]",
            show_default=False,
        ),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html",
            help="Write a page to look at: the episode in 3-D, probe by probe, and the tree as it"
            " was pruned. One file, opens offline in a browser. [dim]default: no page[/]",
            show_default=False,
        ),
    ] = None,
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Draw nothing.")] = False,
    position_error: Annotated[
        float,
        typer.Option(
            metavar="M", help="A contact is felt within this distance of the truth, metres."
        ),
    ] = 0.000254,
    normal_error_deg: Annotated[
        float,
        typer.Option(metavar="A", help="A normal is felt within this angle of the truth, degrees."),
    ] = 18.0,
    max_probes: Annotated[
        int, typer.Option(metavar="N", min=1, help="Give up after this many probes.")
    ] = 40,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of the story.")
    ] = False,
) -> None:
    """Touch an object in simulation until palpate knows which one it is and where it lies.

    Prints what could still be true after each probe, and draws the end as a picture. With --video
    it also films the episode, which takes about as long to draw as to watch, or a few times that.
    """
    import numpy as np
    from rich.console import Console

    from ...envs.pictures.picture import check_path
    from ...envs.pictures.video import check_video_path
    from ...envs.probe_env import ProbeEnv
    from ...policies import make_policy
    from ..benchmark.playing import task_of

    if not no_picture:
        check_path(picture)
    if video is not None:
        check_video_path(video)
    if html is not None:
        from ..page.page import check_page_path

        check_page_path(html)
    env = ProbeEnv(
        library,
        object_name=object_name,
        placement=cast("Literal['across', 'resting', 'dropped']", placement),
        free=free,
        sensor=sensor,
        force_threshold=force,
        position_error=position_error,
        normal_error=float(np.radians(normal_error_deg)),
        max_probes=max_probes,
    )
    chooser = make_policy(policy, task_of(env))
    console = Console(highlight=False, quiet=json, soft_wrap=True)
    console.print(
        f"An unknown object, one of {len(env.library)},"
        f" {'lies across' if placement == 'across' else 'stands on'} a plane (seed {seed},"
        f" positions ±{1e3 * position_error:.3g} mm, normals ±{normal_error_deg:.3g}°)."
    )
    if library is not None and (sensor in ("ball", "finger") or placement == "dropped"):
        _tell_strays(env, console)
    record, ruled_out = _play(env, chooser, seed, console)
    if json:
        print(json_format.dumps(_document(env, record.probes[-1], seed), indent=2))
    else:
        console.print(verdict(record.probes[-1]))
    if not no_picture:
        _draw(record.probes[-1], ruled_out, picture, console)
    if video is not None:
        _film(record, video, console)
    if html is not None:
        from ..page.page import write_page
        from ..page.story_episode import episode_story

        size = write_page(episode_story(record), html)
        console.print(f"page: {html}, {1e-6 * size:.1f} MB, opens in a browser")


def _play(
    env: ProbeEnv, chooser: Policy, seed: int, console: Console
) -> tuple[EpisodeRecord, list[tuple[Hypothesis, str]]]:
    """Play an episode and tell it; the record of it, and what was ruled out, the latest first."""
    import numpy as np

    from ...envs.pictures.episode import Episode
    from ...envs.pictures.film_script import EpisodeRecord
    from ..benchmark.playing import probes

    console.print(
        f"{'probe':<8}  {'its rays met':<20}  interpretations  hypotheses left", style="dim"
    )
    _, info = env.reset(seed=seed)  # as `probes` does
    states = [Episode.of(env, info)]
    ruled_out: list[tuple[Hypothesis, str]] = []
    before = env.belief
    for one in probes(env, chooser, seed):
        states.append(one)
        console.print(probe_line(len(env.touches), env.touches[-1], env.belief))
        moved = env.touches[-1].displacement
        if moved.distance > TOLD_PUSH:
            console.print(
                f"          it was pushed: {1e3 * moved.distance:.2f} mm,"
                f" {np.degrees(moved.turn):.2f}°; {len(env.contacts)} contacts still hold",
                style="dim",
            )
        if before is not None and env.belief is not None and before is not env.belief:
            ruled_out = _ruled_out(one, before, env.belief) + ruled_out
        before = env.belief
    return EpisodeRecord(states[0], tuple(states[1:]), verdict_in_short(states[-1])), ruled_out


def _tell_strays(env: ProbeEnv, console: Console) -> None:
    """Say of each mesh how far what is collided with strays from it, where it does."""
    from ...envs.collision.collision import collision_parts

    for model in env.library:
        line = stray_line(model, collision_parts(model))
        if line:
            console.print(line)


def _ruled_out(episode: Episode, before: Belief, after: Belief) -> list[tuple[Hypothesis, str]]:
    """The heaviest hypotheses of one belief that no hypothesis of the next resembles."""
    from ...envs.pictures.episode_picture import likeness_of

    likeness, gone = likeness_of(episode), []
    for old in before.hypotheses:
        if len(gone) < MOST_GHOSTS and not likeness.any_alike(
            old.object_name, old.pose, after.hypotheses
        ):
            gone.append((old, f"{old.object_name}, ruled out by probe {len(episode.touches)}"))
    return gone


def _document(env: ProbeEnv, episode: Episode, seed: int) -> dict[str, object]:
    """The episode as the --json document.

    A hypothesis whose pose is not fixed stands for a family of poses: it is listed once for each
    pose of a sample that spans it, its weight shared out, all under one ``family`` number.
    """
    belief = env.belief
    listed = []
    for number, hypothesis in enumerate(belief.hypotheses if belief else ()):
        share = max(1, MOST_POSES // len(belief.hypotheses)) if belief else 1
        poses = env.recognizer.sample_poses(hypothesis, env.contacts, share)
        listed += [
            {
                "object": hypothesis.object_name,
                "pose": pose.as_matrix().tolist(),
                "weight": hypothesis.weight / len(poses),
                "family": number,
                "determined": hypothesis.determined,
            }
            for pose in poses
        ]
    return {
        "truth": {
            "object": episode.true_object.name,
            "pose": episode.T_world_object.as_matrix().tolist(),
        },
        "hypotheses": listed,
        "unique": belief.unique if belief else False,
        "complete": belief.complete if belief else True,
        "probes": len(env.touches),
        "contacts": len(env.contacts),
        "seed": seed,
    }


def _draw(
    episode: Episode, ruled_out: list[tuple[Hypothesis, str]], path: Path, console: Console
) -> None:
    from ...envs.pictures.episode_picture import episode_picture
    from ...envs.pictures.picture import draw, renderer_note

    belief = episode.belief
    alive = belief.hypotheses[1:] if belief and not belief.unique else ()
    rivals = [(rival, f"{rival.object_name}, still possible") for rival in alive]
    summary = "recognised" if belief and belief.unique else "not unique yet"
    scene = episode_picture(
        episode,
        (rivals + ruled_out)[:MOST_GHOSTS],
        title=f"{episode.true_object.name}: {summary}",
        subtitle=f"{count(len(episode.touches), 'probe')},"
        f" {count(len(episode.contacts), 'contact')} on the object",
    )
    note = renderer_note(draw(scene, path))
    console.print(f"\npicture: {path}" + (f" ({note})" if note else ""))


def _film(record: EpisodeRecord, path: Path, console: Console) -> None:
    """Film an episode, with a bar on stderr that says how far it is."""
    from rich.console import Console
    from rich.progress import Progress

    from ...envs.pictures.episode_film import film_episode
    from ...envs.pictures.picture import renderer_note

    shown = Console(stderr=True)
    with Progress(console=shown, transient=True, disable=not shown.is_terminal) as bar:
        task = bar.add_task("drawing the video", total=None)
        film = film_episode(
            record,
            path,
            progress=lambda drawn, of: bar.update(task, completed=drawn, total=of),
        )
    note = renderer_note(film.renderer, "video")
    console.print(f"video: {path}, {film.seconds:.0f} s" + (f" ({note})" if note else ""))
