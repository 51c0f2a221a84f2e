"""Damaged and hostile robot files are refused in a line or roll, in a process that outlives them.

They come from a generator with a seed, and run in one process, which reports each file's outcome.
"""

import json
import random
import re
import resource
import subprocess
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.robotball.scene_files.scene_texts import PLATE
from tests.robotball.user_model.test_robot_file import GIMBAL, HULL

ALL = range(60)  # four seeds of each kind of damage
# One seed of each kind that fails in a place of its own; a file that is huge takes five seconds.
FEW = (4, 9, 10, 12, 14, 20)
SECONDS, MEMORY = 600.0, 1e9  # s, of a process that hangs; byte

# With an included part, classes of defaults and a mesh.
DRESSED = """<mujoco><compiler angle="radian" meshdir="."/><include file="part.xml"/>
<default><default class="inner"><geom contype="0" conaffinity="0" density="500"/>
 <joint damping=".01"/></default></default>
<asset><mesh name="wedge" file="wedge.obj" scale=".05 .05 .05"/></asset>
<worldbody><body name="ball" pos="0 0 .2"><freejoint/><geom size=".2" mass="1"/>
 <body childclass="inner"><joint name="j" axis="0 1 0"/>
  <geom type="mesh" mesh="wedge" pos="0 0 -.05"/></body></body></worldbody></mujoco>"""
BESIDE = {
    "part.xml": '<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>',
    "wedge.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n",
}
BASES = {"plate.xml": PLATE, "gimbal.xml": GIMBAL, "hull.urdf": HULL, "dressed.xml": DRESSED}
NUMBER = re.compile(r"(?<=[\"' ])[-+.\d][-+.\deE]*(?=[\"' ])")
VALUE = re.compile(r'"[^"]*"')
ELEMENT = re.compile(r"<[^<>]+/>")
NUMBERS = ["nan", "inf", "-1", "0", "1e308", "-1e9", "1e-320", "1e400", "", "99999999999", "½"]
# Elements that need more memory than a machine has.
LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
HUGE = [
    '<asset><texture type="2d" builtin="flat" width="200000" height="200000"/></asset>',
    '<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>',
    '<worldbody><replicate count="100000000"><geom size=".1"/></replicate></worldbody>',
    '<worldbody><composite prefix="p" type="grid" count="3000 3000 1" spacing="1"/></worldbody>',
    '<option timestep="-1" iterations="2000000000"/><size nkey="2000000000"/>',
    '<custom><numeric name="n" size="2000000000"/></custom>',
]


def _spans(rng: random.Random, text: str) -> tuple[str, str, str]:
    """Cut a text at two places."""
    at, end = sorted(rng.sample(range(len(text) + 1), 2))
    end = min(end, at + 60)
    return text[:at], text[at:end], text[end:]


def _replaced(rng: random.Random, text: str, pattern: re.Pattern[str], by: str) -> str:
    match = rng.choice(list(pattern.finditer(text)))
    return text[: match.start()] + by + text[match.end() :]


def _swapped(rng: random.Random, text: str) -> str:
    one, other = rng.sample([match.group() for match in VALUE.finditer(text)], 2)
    return text.replace(one, "\0").replace(other, one).replace("\0", other)


def _nested(rng: random.Random, text: str) -> str:
    deep = rng.choice([100, 3000, 30_000])
    hung = '<body pos="0 0 .1"><joint axis="1 0 0"/><geom size=".1" contype="0"/>' * deep
    return text.replace("</worldbody>", hung + "</body>" * deep + "</worldbody>")


def _begun(text: str, added: str) -> str:
    """Put elements in front of all others."""
    return re.sub(r"(<mujoco[^>]*>|<robot[^>]*>)", lambda m: m.group() + added, text, count=1)


Damage = Callable[[random.Random, str], str | bytes]
DAMAGE: dict[str, Damage] = {
    "cut off": lambda rng, text: text[: rng.randrange(len(text))],
    "deleted": lambda rng, text: "".join(_spans(rng, text)[::2]),
    "doubled": lambda rng, text: "{0}{1}{1}{2}".format(*_spans(rng, text)),
    "swapped": _swapped,
    "number": lambda rng, text: _replaced(rng, text, NUMBER, rng.choice(NUMBERS)),
    "value": lambda rng, text: _replaced(rng, text, VALUE, f'"{rng.choice(NUMBERS)}"'),
    "element": lambda rng, text: _replaced(rng, text, ELEMENT, ""),
    "element twice": lambda rng, text: _replaced(
        rng, text, ELEMENT, 2 * rng.choice(ELEMENT.findall(text))
    ),
    "bytes": lambda rng, text: rng.randbytes(4).join(
        each.encode() for each in _spans(rng, text)[::2]
    ),
    "nested": _nested,
    "includes itself": lambda rng, text: _begun(text, '<include file="damaged.xml"/>'),
    "huge": lambda rng, text: _begun(text, rng.choice(HUGE)),
    "laughs": lambda rng, text: f"<!DOCTYPE m [<!ENTITY l0 'ha'>{LAUGHS}]>{_begun(text, '&l11;')}",
    "encoded": lambda rng, text: text.encode(rng.choice(["utf-16", "utf-7", "utf-32", "cp500"])),
    "beside": lambda rng, text: _begun(
        text, f'<include file="{rng.choice(["", ".", "none.xml", "/dev/zero", "wedge.obj"])}"/>'
    ),
}
KINDS = list(DAMAGE)


def damaged(seed: int, folder: Path) -> Path:
    """Write the file of a seed, and return it."""
    rng = random.Random(seed)
    name = rng.choice(list(BASES))
    for other, text in BESIDE.items():
        (folder / other).write_text(text)
    path = folder / f"damaged{Path(name).suffix}"
    content = DAMAGE[KINDS[seed % len(KINDS)]](rng, BASES[name])
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def _largest_memory() -> int:
    """Return the most memory in bytes that this process or a child of it has held."""
    # ru_maxrss of this process starts at the size of its parent, a test worker.
    (peak,) = re.findall(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())
    return 1024 * max(int(peak), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)


def _report(folder: Path, seeds: list[int]) -> None:
    """Print a line of JSON for each seed: its number, its damage, the outcome and the memory."""
    warnings.simplefilter("ignore")
    for seed in seeds:
        outcome = "rolls"
        try:
            rb.integrate(rb.load_scene(str(damaged(seed, folder))), np.linspace(0.0, 0.1, 3))
        except rb.InputError as error:
            outcome = f"refused: {error}"
        except Exception as error:  # the fault that this test looks for
            outcome = f"{type(error).__name__}: {error}"
        print(json.dumps([seed, KINDS[seed % len(KINDS)], outcome, _largest_memory()]), flush=True)


@pytest.mark.usefixtures("linux")
@pytest.mark.parametrize(
    "seeds", [pytest.param(FEW, id="few"), pytest.param(ALL, id="all", marks=pytest.mark.study)]
)
def test_damaged_files_are_refused_in_a_line_or_roll(seeds: Sequence[int], tmp_path: Path) -> None:
    """No traceback, no end of the process, no hang, and less than 1 GB; measured 0.25 GB."""
    command = [sys.executable, "-m", __name__, str(tmp_path), *map(str, seeds)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line[0] for line in lines] == [*seeds], done.stderr[-500:]
    assert {line[1] for line in lines} == {KINDS[seed % len(KINDS)] for seed in seeds}
    sound = re.compile(r"rolls|refused: [^\n]+")
    assert [line for line in lines if not sound.fullmatch(line[2])] == []
    assert max(line[3] for line in lines) < MEMORY


if __name__ == "__main__":
    _report(Path(sys.argv[1]), [*map(int, sys.argv[2:])])
