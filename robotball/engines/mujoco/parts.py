"""Steps in parts: at torque limits, near a standstill, and where MuJoCo has warned."""

import time
from collections.abc import Iterator

import mujoco
import numpy as np

from robotball.engines.mujoco.control import Control, Portion, Stretch, TooManyPartsError, read_row
from robotball.motion import DIVERGED, Fault, FaultKind
from robotball.rotations import Array

_LOOK = 64  # parts between two looks of the monitor; at most so many are taken after a fault


def step_in_parts(control: Control, data: mujoco.MjData, stretch: Stretch) -> Iterator[Portion]:
    """Take the steps of a stretch, with a row for every part of a step."""
    rows: list[Array] = []
    sampled: list[int] = []
    longest, began = 0.0, time.thread_time()

    def portion(failure: Fault | None = None) -> Portion:
        table = np.array(rows).reshape(len(rows), len(data.sensordata) + len(data.warning.number))
        at, seconds = np.array(sampled, dtype=np.int64), time.thread_time() - began
        return Portion(table, at[at < len(rows)], len(rows), longest, seconds, failure)

    samples, step = {*stretch.samples.tolist()}, 0
    for span, length, count in stretch:
        control.begin(data, span)
        for _ in range(count):
            if step in samples:
                sampled.append(len(rows))
            step += 1
            control.planned += 1
            # A diverged state has neither switches nor a standstill.
            sound = max(np.abs(data.qpos).max(), np.abs(data.qvel).max()) < DIVERGED
            steps = control.steps if sound else None
            try:
                for taken in (steps or control.whole)(data, length):
                    rows.append(read_row(data))
                    longest = max(longest, taken)
                    if len(rows) == _LOOK:
                        yield portion()
                        rows, sampled, longest, began = [], [], 0.0, time.thread_time()
            except TooManyPartsError as error:
                yield portion(Fault(FaultKind.STEP_TOO_SHORT, np.nan, str(error), fatal=True))
                return
    yield portion()
