"""Write motions as a self-contained web page with a 3-D view to orbit, play and scrub."""

import html
from base64 import b64encode
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball.errors import InputError
from robotball.files import embedded_json
from robotball.robot import looks as palette
from robotball.robot.ball import Ball
from robotball.robot.looks import MARKS, Looks, looks_of, materials_of
from robotball.robot.shapes import Shape
from robotball.view.tracks import (
    SLIPS,
    colours_of,
    heading_of,
    label_of,
    slip_parts,
    slips_of,
    track_of,
)

_HERE = Path(__file__).parent
STEP = 0.02  # s between the samples of a view
MOST = 20_000  # samples, to keep a page below some megabytes
_MESHES = 60_000  # triangles of all meshes, less than two megabytes


def view_head() -> str:
    """Return the style and script shared by all views of a page; include it once."""
    style, script = ((_HERE / f"web.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    return f"<style>{style}</style>\n<script>{script}</script>"


def view_fragment(motions: Sequence[Any]) -> str:
    """Return HTML of a 3-D view of motions of one scene; `view_head` must precede it.

    The balls are side by side, or the last ball is a ghost over the others. Motions are cut after
    MOST samples. Raises InputError for a motion with fewer than two samples.
    """
    data = view_data(motions)
    shown, whole = data["end"], max(float(motion.times[-1]) for motion in motions)
    if shown < whole * (1 - 1e-9):
        data["note"] = f"Showing the first {shown:g} s of {whole:g} s."
    if any(map(slips_of, motions)):
        data["note"] = f"Yellow path: the ball slips. {data.get('note', '')}"
    data["label"] = f"Rolling ball {motions[0].scene.name}"
    return (
        '<div class="rb-view">'
        f'<script type="application/json">{embedded_json(data)}</script><script>'
        "rollingBalls(document.currentScript.parentElement);</script></div>"
    )


def view_page(motions: Sequence[Any]) -> str:
    """Return an HTML page with only the view."""
    title = html.escape(" ".join(motions[0].scene.title.split()))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">'
        f"<title>{title}</title>{view_head()}\n"
        "<style>body { margin: 1em auto; max-width: 75em; padding: 0 1em; }"
        "h1 { font: 600 1.2em system-ui, sans-serif; }</style></head>\n"
        f"<body><h1>{title}</h1>\n{view_fragment(motions)}\n</body></html>\n"
    )


def view_data(motions: Sequence[Any]) -> dict[str, Any]:
    """Return the data of the script: bodies, materials, and one row per sample for each ball.

    If all meshes together have more than _MESHES triangles, nearby corners are merged.
    """
    scene = motions[0].scene
    if min(len(motion.times) for motion in motions) < 2:
        raise InputError("a view needs motions with at least two samples")
    last = max(float(motion.times[-1]) for motion in motions)
    # Samples are STEP apart, or closer for a very short motion.
    step = min(STEP, last / 2)
    end = min(last, step * (MOST - 1))
    grid = np.asarray(step * np.arange(int(np.floor(end / step * (1 + 1e-9))) + 1), dtype=float)
    parts = [track_of(motion).at(grid[grid <= motion.times[-1] * (1 + 1e-9)]) for motion in motions]
    ball, looks = scene.ball, looks_of(scene.ball)
    shared = min(len(part.attitude) for part in parts)
    rest = parts[-1].contact_point[:shared]
    return {
        "step": step,
        "end": float(grid[-1]),
        "count": len(grid),
        "hinges": len(scene.hinges),
        "heading": heading_of(parts[-1].contact_point),
        "bodies": list(_bodies(ball, looks)),
        "materials": materials_of(looks),
        "band": palette.rgb(SLIPS.colour),
        "balls": [
            {
                "name": label_of(motion),
                "colour": palette.rgb(colour),
                "count": len(part.attitude),
                "slips": [
                    (samples.start, samples.stop)
                    for samples in slip_parts(slips_of(motion), grid[: len(part.attitude)])
                ],
                "apart": _packed(np.linalg.norm(part.contact_point[:shared] - rest, axis=1)),
                "rows": _packed(
                    np.hstack([part.contact_point / ball.radius, part.attitude, part.hinge_angles])
                ),
            }
            for motion, part, colour in zip(motions, parts, colours_of(motions), strict=True)
        ],
    }


def _bodies(ball: Ball, looks: Looks) -> Iterator[dict[str, Any]]:
    """Yield each body with its shapes and the joint to its parent, given by index.

    Motions give the attitude of the frame, so the shell is a child of the frame and turns
    backwards. Without a frame, motions give the attitude of the shell.
    """
    names, carrier = [link.name for link in ball.tree], int(ball.has_frame)
    meshes = sum(shape.kind == "mesh" for shapes in looks.values() for shape in shapes)
    for i, link in enumerate(ball.tree):
        joint, sign = (ball.tree[carrier], -1) if i < carrier else (link, 1)
        parent = carrier if i < carrier else names.index(link.parent or link.name)
        marked = any(shape.material == MARKS for shape in looks[link.name])
        yield {
            "name": link.name,
            "parent": -1 if i == carrier else parent,
            "hinge": max(i, 1) - 1,
            "sign": sign,
            "slides": joint.slides,
            "axis": (joint.axis / (ball.radius if joint.slides else 1)).tolist(),
            "pivot": (joint.pivot / ball.radius).tolist(),
            "marked": marked,
            "shapes": [_json_tree(shape, meshes) for shape in looks[link.name]],
        }


def _json_tree(shape: Shape, meshes: int) -> dict[str, Any]:
    """Return a shape as data for the script; meshes: number of meshes that share the triangles."""
    thin = shape.thinned(_MESHES // max(meshes, 1))
    return {
        "kind": shape.kind,
        **{name: getattr(shape, name).round(6).tolist() for name in ("size", "pos", "turn")},
        "material": shape.material,
        "mesh": [_packed(thin.vertices), _packed(thin.faces)],
    }


def _packed(numbers: NDArray[Any]) -> str:
    """Encode numbers as base64 of little-endian 32-bit floats, which halve the page's size."""
    return b64encode(numbers.astype("<f4").tobytes()).decode("ascii")
