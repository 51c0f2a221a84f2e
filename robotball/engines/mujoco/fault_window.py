"""A file with the states around the first fault of a run, from which they can be stepped again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
import mujoco
import numpy as np

from robotball.engines.mujoco.model import Model, compiled_model, hinges_of
from robotball.engines.mujoco.monitor import Found
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.settings import ADAPTIVE, settings_from
from robotball.engines.mujoco.stepping import (
    STATE,
    Portion,
    controlled,
    read_row,
    state_of,
    switched,
)
from robotball.errors import InputError
from robotball.files import contents
from robotball.files.replacing import replacing
from robotball.files.scene_file import read_scene
from robotball.files.scene_writer import scene_toml
from robotball.rotations import Array
from robotball.scene import Scene

AROUND = 20  # steps on either side of the first bad one
_Numbers = list[list[float | None]]  # null where a number is not finite


class FaultWindow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Consecutive rows of a run with the first bad one among them, and all that it depends on.

    scene: TOML; None where a drive is a function of time, which no file holds. bad: the index of
    the bad row; their number where the run could not go on after the last. causes, time: of the
    faults that begin there [s]. table: a row for each row of the window, under `columns`, in SI
    units. states, lengths, spans, sides: the origin of each row, as in Step.
    """

    format: Literal["robotball fault 1"]
    name: str
    scene: str | None
    settings: dict[str, Any]
    mujoco: str
    bad: int
    causes: list[str]
    time: float
    columns: list[str]
    table: _Numbers
    states: _Numbers
    lengths: list[float]
    spans: list[tuple[float, float]]
    rows: _Numbers
    xml: str
    sides: list[list[int]]

    @property
    def model(self) -> Any:
        """The compiled model. Raises InputError where MuJoCo refuses it."""
        try:
            return compiled_model(self.xml, self.settings.get("softness", 1.0))
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None

    def coordinates(self, row: int) -> tuple[list[float | None], list[float | None]]:
        """Return qpos and qvel of a row, with None for numbers that are not finite."""
        model = self.model
        after_time = self.states[row][1 : 1 + model.nq + model.nv]
        return after_time[: model.nq], after_time[model.nq :]

    @property
    def adaptive(self) -> bool:
        """True if the steps were chosen by their error."""
        return self.settings.get("integrator") == ADAPTIVE


def window_around(
    model: Model, found: list[Found], portion: Portion, before: Portion | None
) -> FaultWindow:
    """Return the window around the first fault found in a portion, with rows of the one before."""
    portions = [portion] if before is None else [before, portion]
    steps = [step for each in portions for step in each.again()]
    rows = np.concatenate([each.rows for each in portions])
    bad = found[0].row + len(rows) - len(portion.rows)
    first = max(0, bad - AROUND)
    kept = slice(first, bad + AROUND + 1)
    rows, steps = rows[kept], steps[kept]
    states = np.array([step.state for step in steps])
    with np.errstate(all="ignore"):  # a diverged state's numbers have no squares
        columns = _table(model, rows, states)
    return FaultWindow(
        format="robotball fault 1",
        name=model.scene.name,
        scene=_text(model.scene),
        settings=model.settings.plain(),
        mujoco=mujoco.__version__,
        bad=bad - first,
        # Faults of later rows may only follow from the first.
        causes=[each.fault.text for each in found if each.row == found[0].row],
        time=found[0].fault.time,
        columns=list(columns),
        table=_without_arrays(np.column_stack(list(columns.values()))),
        states=_without_arrays(states),
        lengths=[float(step.length) for step in steps],
        spans=[(float(step.span[0]), float(step.span[1])) for step in steps],
        rows=_without_arrays(rows),
        xml=model.xml,
        sides=[step.sides for step in steps],
    )


def write(path: Path, window: FaultWindow) -> None:
    """Write the window as JSON. Raises InputError where that fails."""
    with replacing(path) as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(window), indent=1))


def load(path: Path) -> FaultWindow:
    """Return the fault window in a file. Raises InputError where the file holds none."""
    data = contents(path)
    try:
        saved = msgspec.json.decode(data, type=FaultWindow)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: no fault window of a run: {error}") from None
    rows = len(saved.rows)
    columns = (saved.table, saved.states, saved.lengths, saved.spans)
    # No field is used before all agree, so that no stranger's file ends in an error of ours.
    widths = {len(each) for each in saved.table} | {len(saved.columns)}
    if not (all(len(each) == rows for each in columns) and 0 <= saved.bad <= rows) or not rows:
        raise InputError(f"{path}: no fault window of a run: its rows do not match each other")
    if len(widths) > 1:
        raise InputError(f"{path}: no fault window of a run: its columns do not match each other")
    return saved


@dataclass(frozen=True)
class Replayed:
    """The result of stepping a fault window again.

    rows        the number that was compared
    difference  the largest of any number of state or reading, 0 where all are the same to the last
                bit; None where it could not be done
    why         it could not be done
    """

    rows: int
    difference: float | None
    why: str = ""


def replay(saved: FaultWindow) -> Replayed:
    """Step the model again from the first state, and compare every state and reading.

    An adaptive run is not stepped; its forces are computed again at its states.
    """
    # Another version's last digits differ, and a fault magnifies them.
    if saved.mujoco != mujoco.__version__:
        return Replayed(
            0, None, f"it is of MuJoCo {saved.mujoco}, and this is {mujoco.__version__}"
        )
    if saved.scene is None:
        return Replayed(0, None, "its drives are functions of time, which no file holds")
    scene = read_scene(Path(f"{saved.name}.toml"), saved.scene)
    settings = settings_from(saved.settings)
    model = Model(scene, settings, saved.xml, hinges_of(scene, settings))
    compiled = model.compiled
    states, rows = _array(saved.states), _array(saved.rows)
    data = mujoco.MjData(compiled)
    shape = (mujoco.mj_stateSize(compiled, STATE), len(read_row(data)))
    if states.shape[1:] != shape[:1] or rows.shape[1:] != shape[1:]:
        raise InputError(f"{saved.name}: the fault window's states are not of its model")
    worst = 0.0
    readings = slice(0, compiled.nsensordata)  # the counters of warnings begin anew
    steps = zip(
        states, rows, saved.lengths, saved.spans, saved.sides or [[]] * len(rows), strict=True
    )
    with (
        controlled(model) as control,
        switched(control) as switches,
        np.errstate(all="ignore"),
    ):
        mujoco.mj_setState(compiled, data, states[0], STATE)
        for state, row, length, span, sides in steps:
            if saved.adaptive:
                mujoco.mj_setState(compiled, data, state, STATE)
            control.span = span
            if switches and sides:
                switches.set(sides)
            # As the run did before its step; the state that it kept is of after that.
            if control.resistance and length:
                control.stop(data)
            worst = max(worst, _difference(state_of(data), state))
            if length:  # else the state is the last, or an adaptive run's
                compiled.opt.timestep = length
                mujoco.mj_step(compiled, data)
            else:
                mujoco.mj_forward(compiled, data)
            worst = max(worst, _difference(read_row(data)[readings], row[readings]))
    return Replayed(len(rows), worst)


def _difference(a: Array, b: Array) -> float:
    """Return the largest difference, infinite where a number is finite in one alone."""
    both = np.isfinite(a) & np.isfinite(b)
    if (np.isfinite(a) != np.isfinite(b)).any():
        return np.inf
    return float(np.abs(a - b)[both].max(initial=0.0))


def _table(model: Model, rows: Array, states: Array) -> dict[str, Array]:
    """Return the columns (m,) that `robotball replay` shows, named with their units."""
    readings, compiled = Readings(model, rows), model.compiled
    first_velocity = 1 + compiled.nq  # of an integration state: time, qpos, qvel, ...
    velocities = states[:, first_velocity : first_velocity + compiled.nv]
    off = np.linalg.norm(readings.momentum - model.scene.start.momentum, axis=1)
    return {
        "time [s]": readings.time,
        "height [m]": readings.centre[:, 2],
        "slip [m/s]": readings.slip,
        "spin [rad/s]": readings.spin,
        "momentum error": off / model.scene.momentum_scale,
        "friction used": readings.friction_used,
        "hinge rate error": readings.hinge_rate_error(model.hinges),
        "normal force [N]": readings.contact_force[:, 0],
        "largest velocity": np.abs(velocities).max(axis=1),
    }


def _text(scene: Scene) -> str | None:
    """Return the scene as TOML, None where no file can hold it."""
    try:
        return scene_toml(scene)
    except InputError:
        return None


def _without_arrays(values: Array) -> _Numbers:
    """Replace numbers that are not finite, which JSON does not have."""
    return [[v if np.isfinite(v) else None for v in row] for row in values.tolist()]


def _array(values: _Numbers) -> Array:
    """Return the inverse of `_without_arrays`. Raises InputError where rows differ in length."""
    try:
        return np.array([[np.nan if v is None else v for v in row] for row in values])
    except ValueError as error:
        raise InputError(f"no fault window of a run: {error}") from None
