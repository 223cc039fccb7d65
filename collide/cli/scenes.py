"""The scenes that commands are about: loaded as the arguments say, and reported on in each state asked for."""

from __future__ import annotations

import re
from collections.abc import Callable

from collide.errors import InvalidArgument


def reports(args, progress: Callable, started: float | None, **limits) -> list:
    """Load the scene of the arguments and report on it, in each state asked for: `state_reports.Stated`.

    started : ``time.perf_counter()`` when the command began, or ``None``.   limits : ``clearance``, ``min_depth`` [m].
    """
    scenes = load_states(args, progress)
    trajectory = _trajectory(args, scenes)
    if args.certify and (trajectory is None or limits.get("min_depth")):
        wanted = "leave out --min-depth" if trajectory is not None else "give --trajectory"
        raise InvalidArgument(f"--certify proves that nothing meets along a trajectory: {wanted}")
    ignore = [_pair(scenes[0][1], words) for words in args.ignore]
    from collide.reports import report
    from collide.reports import state_reports as states
    from collide.reports.trajectory_report import at_start, watched

    made = []
    for label, scene in scenes:
        if trajectory is not None:
            scene = at_start(scene, trajectory)
        state_report, watch = report.make(
            scene, progress=progress, started=started, ignore=ignore, depth=args.depth, **limits
        ), None
        if trajectory is not None:
            tested = report.without(scene, ignore)
            watch = watched(
                tested, trajectory, resolution=args.resolution, progress=progress, keep=bool(args.html), **limits
            )
            state_report.trajectory = watch.to_dict()
            if args.certify:
                from collide.reports.trajectory_proof import RESOLUTION, prove

                resolution = min(args.resolution, RESOLUTION)
                proof = prove(tested, watch.path, limits.get("clearance", 0.0), resolution, progress)
                state_report.trajectory |= {"proof": proof, "certified": proof["free"]}
        made.append(states.Stated(label, scene, state_report, watch))
    return made


def _trajectory(args, scenes):
    if args.trajectory is None:
        return None
    if len(scenes) > 1:
        raise InvalidArgument("--trajectory starts from one state: give --state once, with one state")
    from collide.scenes.loaders.trajectories import read_trajectory

    return read_trajectory(args.trajectory)


def _pair(scene, words: str) -> tuple[str, str]:
    """The two bodies that ``A,B`` names; a comma may also stand in a name."""
    names = {body.name for body in scene.bodies}
    pieces = words.split(",")
    splits = [(",".join(pieces[:k]).strip(), ",".join(pieces[k:]).strip()) for k in range(1, len(pieces))]
    if not splits:
        raise InvalidArgument(f"--ignore: takes two bodies, A,B, got {words!r}")
    for a, b in splits:
        if a in names and b in names and a != b:
            return a, b
    a, b = splits[0]
    if a == b:
        raise InvalidArgument(f"--ignore: {a!r} twice; a body is never tested against itself")
    import difflib

    wrong = b if a in names else a
    near = difflib.get_close_matches(wrong, sorted(names), 3, 0.5)
    known = [body.name for body in scene.bodies]
    listed = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
    hint = f"did you mean {' or '.join(near)}?" if near else f"it has {listed}"
    raise InvalidArgument(f"--ignore: scene {scene.name} has no body {wrong!r}; {hint}")


def load_states(args, progress: Callable) -> list:
    """The scene in each state asked for: (label, Scene); one without a label where no state was named."""
    from collide.scenes import load

    options = ("robot", "srdf", "meshes", "missing_meshes", "package_path", "scale")
    load_options = {name: getattr(args, name) for name in options if getattr(args, name) is not None}
    words = args.state or []
    if not words or (len(words) == 1 and not re.search(r"[,=]|^[-+\d.]", words[0])):  # a name, or a file
        return [("", load(*args.scenes, state=words[0] if words else None, progress=progress, **load_options))]
    from collide.scenes.loaders.state_words import in_states

    states = in_states(load(*args.scenes, state=None, progress=progress, **load_options), words)
    return states if len(states) > 1 else [("", states[0][1])]
