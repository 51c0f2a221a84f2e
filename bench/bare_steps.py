"""Step a model by plain calls of MuJoCo, of whatever version.

An environment of an old version runs it, so it imports that version and nothing of ours: no change
of our own code can be taken for one of the engine.
"""

import re
import time
from collections.abc import Mapping
from typing import Any

import mujoco

_REFUSED = r"unrecognized attribute: '(\w+)'"


def compiled(xml: str) -> tuple[mujoco.MjModel, list[str]]:
    """Return the model of an MJCF, and its attributes that this version refuses and go without.

    Raises ValueError, by the version's parser, for any other fault.
    """
    left_out: list[str] = []
    while True:
        try:
            return mujoco.MjModel.from_xml_string(xml), left_out
        except ValueError as error:
            # The parser names one attribute at a time, the first that it does not know.
            if (found := re.search(_REFUSED, str(error))) is None:
                raise
            left_out.append(found[1])
            xml = re.sub(f' {found[1]}="[^"]*"', "", xml)


def run(task: Mapping[str, Any]) -> dict[str, Any]:
    """Run a task: an MJCF, the interval [s] and number of its samples, and how often for the time.

    Of the answer qpos and qvel are at the samples, and seconds is the least processor time.
    """
    model, left_out = compiled(task["xml"])
    data, spent = mujoco.MjData(model), []
    every = round(task["interval"] / model.opt.timestep)
    for _ in range(task["rounds"]):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        qpos, qvel, began = [data.qpos.tolist()], [data.qvel.tolist()], time.process_time()
        for _ in range(task["samples"] - 1):
            mujoco.mj_step(model, data, every)
            qpos.append(data.qpos.tolist())
            qvel.append(data.qvel.tolist())
        spent.append(time.process_time() - began)
    # The least, as what disturbs a run makes it longer, and nothing makes it shorter.
    answer = {"qpos": qpos, "qvel": qvel, "timestep": model.opt.timestep, "seconds": min(spent)}
    return {**answer, "left_out": left_out}
