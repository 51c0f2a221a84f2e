"""How many random starts reach each attractor of a scene."""

from robotball.dynamics.long_run import CHAOS, LINE, LOST, TORUS, basins
from robotball.errors import check_count

from ..output import progress_bar
from ..study import Column, Study, table_of
from .contact_sections import attracted_scene, level_starts


def basins_study(name: str, starts: int, transient: float, seed: int) -> Study:
    """Find which attractor each of many random starts reaches."""
    scene = attracted_scene(name, "a basin")
    check_count("starts", starts, 2)
    attitudes, momenta = level_starts(scene, starts, seed)
    with progress_bar(1) as progress:
        progress(0, f"{scene.name}: {starts} starts")
        found = basins(scene.parameters, attitudes, momenta, transient)
    names = {TORUS: "torus", CHAOS: "chaos", LINE: "straight line"}
    names |= {LOST: "stops crossing g = 0"}
    names |= {i: f"cycle of period {of.period:.6f} s" for i, of in enumerate(found.cycles)}
    rows = [
        {"name": word, "share": share}
        for label, word in sorted(names.items(), reverse=True)
        if (share := found.share(label)) > 0
    ]
    columns = (
        Column("attractor", "name", words=True),
        Column("share of the starts", "share", form=".3f"),
    )
    record = {
        "scene": scene.name,
        "seed": seed,
        "transient": transient,
        "attitudes": attitudes.tolist(),
        "reached": [names[label] for label in found.labels.tolist()],
    }
    return Study(scene.name, None, ["basins"], rows, record, [table_of(columns, rows)])
