"""Step a model with plain calls of any MuJoCo version.

An environment with an old version runs this file. It imports nothing from robotball, so that no
change of ours can look like a change of MuJoCo.
"""

import re
import time
from collections.abc import Mapping
from typing import Any

import mujoco

_REFUSED = r"unrecognized attribute: '(\w+)'"


def compiled(xml: str) -> tuple[mujoco.MjModel, list[str]]:
    """Return the model of an MJCF, and the attributes removed because this version refuses them.

    Raises ValueError, from the version's parser, for any other fault.
    """
    left_out: list[str] = []
    while True:
        try:
            return mujoco.MjModel.from_xml_string(xml), left_out
        except ValueError as error:
            # The parser names only the first unknown attribute.
            if (match := re.search(_REFUSED, str(error))) is None:
                raise
            left_out.append(match[1])
            xml = re.sub(f' {match[1]}="[^"]*"', "", xml)


def run(task: Mapping[str, Any]) -> dict[str, Any]:
    """Run a task: xml, interval [s] and number of its samples, and rounds of timing.

    Returns qpos and qvel at the samples, and the least processor time of a round [s].
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
    # The least time: disturbances only make a run slower.
    answer = {"qpos": qpos, "qvel": qvel, "timestep": model.opt.timestep, "seconds": min(spent)}
    return {**answer, "left_out": left_out}
