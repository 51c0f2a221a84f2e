"""Sweeps on a dask cluster: the same results, and one line where there is none."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from robotball import InputError
from tests.validation.work import WORKERS, cells_of, failures, lines_of, square
from validation.sweeps import sweep


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers under a nanny each, as `dask worker` starts them."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        yield cluster


@pytest.mark.slow
def test_a_cluster_gives_the_same_results(tmp_path: Path, cluster: Any) -> None:
    """Records and failures by dask are those by the local cores, resumed ones too."""
    cells, file = cells_of(tmp_path, 12), tmp_path / "cluster.jsonl"
    for x, trouble in {2: "raises", 5: "ends", 7: "spins", 8: "hangs"}.items():
        cells[x]["trouble"] = trouble
    local = sweep(square, cells, tmp_path / "local.jsonl", workers=WORKERS, limit=0.5)
    assert failures(local) == {
        2: "ValueError: no square",
        5: "ended its process with status 7",
        7: "took longer than 0.5 s",
        8: "took longer than 0.5 s",
    }
    sweep(square, cells[:3], file, cluster=cluster.scheduler_address)
    assert sweep(square, cells, file, cluster=cluster.scheduler_address, limit=0.5) == local


@pytest.mark.slow
def test_a_cluster_whose_workers_have_gone_is_not_waited_for(
    tmp_path: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line, and what was done is kept."""
    monkeypatch.setattr("validation.sweeps._CHECK", 0.2)
    monkeypatch.setattr("validation.sweeps._ABSENCE", 0.5)
    file, address = tmp_path / "sweep.jsonl", cluster.scheduler_address

    def leave(done: float, what: str) -> None:
        if done == 3:
            cluster.scale(0)

    with pytest.raises(InputError, match=f"all workers of {address} have gone: start some, and"):
        sweep(square, cells_of(tmp_path, 50, seconds=0.5), file, cluster=address, show=leave)
    assert len(lines_of(file)) >= 3
    with pytest.raises(InputError, match=f"{address} has no workers: start some with `dask worker"):
        sweep(square, cells_of(tmp_path, 50, seconds=0.5), file, cluster=address)
    cluster.scale(2)


@pytest.mark.slow
def test_a_cluster_that_does_not_answer_is_refused(tmp_path: Path) -> None:
    """One line within seconds, and no trouble later."""
    with pytest.raises(InputError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:1: "):
        sweep(square, cells_of(tmp_path, 1), tmp_path / "sweep", cluster="tcp://127.0.0.1:1")


def test_without_dask_a_cluster_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The line says how to install the extra."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'robotball\[cluster\]'"):
        sweep(square, cells_of(tmp_path, 1), tmp_path / "sweep", cluster="tcp://127.0.0.1:1")
