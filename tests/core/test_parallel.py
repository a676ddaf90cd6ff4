"""Tests of semsig_gis.core.parallel; test_distributed.py runs it on real tiles."""

from __future__ import annotations

import contextlib
import os
import signal
from typing import TYPE_CHECKING, Any

import pytest
from distributed import LocalCluster
from sentences import refused

from semsig_gis import __version__
from semsig_gis.core import InputError, Outcome, check_workers, parallel, run_tasks

if TYPE_CHECKING:
    from pathlib import Path


def test_tasks_in_this_process_run_in_order() -> None:
    assert list(run_tasks(abs, [-3, 2, -1])) == [Outcome(-3, 3), Outcome(2, 2), Outcome(-1, 1)]
    assert list(run_tasks(abs, [], workers=2)) == []


def test_workers_return_the_same_outcomes() -> None:
    outcomes = run_tasks(abs, [*range(-5, 0)], workers=2)
    assert sorted(outcomes, key=lambda outcome: outcome.task) == [*run_tasks(abs, [*range(-5, 0)])]


def test_failing_task_is_attempted_three_times() -> None:
    attempts: list[int] = []

    def fail_often(task: int) -> int:
        attempts.append(task)
        if attempts.count(task) < task:
            msg = f"failure {attempts.count(task)}."
            raise InputError(msg) if task % 2 else OSError(msg)
        return task

    outcomes = {outcome.task: outcome for outcome in run_tasks(fail_often, [1, 2, 3, 4, 5])}
    assert [outcomes[task].value for task in range(1, 6)] == [1, 2, 3, None, None]
    assert [outcomes[task].reason for task in (4, 5)] == ["OSError: failure 3.", "failure 3"]
    assert attempts.count(5) == 3


def test_task_that_kills_its_process_fails_and_the_others_finish() -> None:
    def kill_process(task: int) -> int:
        if task == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return task

    outcomes = {
        outcome.task: outcome for outcome in run_tasks(kill_process, [1, 2, 3, 4], workers=2)
    }
    assert {task for task, outcome in outcomes.items() if outcome.value == task} == {1, 3, 4}
    assert outcomes[2].reason == "3 processes died while they worked on it"


@pytest.mark.parametrize(("count", "address"), [(-1, None), (2, "tcp://x:1"), (0, "")])
def test_conflicting_or_invalid_workers_are_refused(count: int, address: str | None) -> None:
    with refused(InputError, "workers", "scheduler", "from 0 up"):
        check_workers(count, address)
    with refused(InputError, "workers", "scheduler", "from 0 up"):
        list(run_tasks(abs, [1], workers=count, scheduler=address))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:9", "carrier://pigeon:1", "x"])
def test_error_names_a_scheduler_that_does_not_answer(
    monkeypatch: pytest.MonkeyPatch,
    address: str,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(parallel, "TIMEOUT_S", 0.3)
    with refused(InputError, address, "cannot be reached", "dask scheduler"):
        list(run_tasks(abs, [1], scheduler=address))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("Client", {"scheduler": "tcp://127.0.0.1:9"}, ("127.0.0.1:9", "cannot be reached")),
        ("Client", {"workers": 2}, ("2 processes", "could not be started", "fewer")),
        ("LocalCluster", {"workers": 2}, ("2 processes", "could not be started", "fewer")),
    ],
)
def test_any_error_of_dask_becomes_one_sentence(
    monkeypatch: pytest.MonkeyPatch, name: str, options: dict[str, Any], words: tuple[str, ...]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(f"distributed.{name}", fail)
    with refused(InputError, *words):
        list(run_tasks(abs, [1], **options))


@pytest.mark.parametrize(
    ("address", "words"), [(None, "the processes"), ("tcp://x:1", "the scheduler tcp://x:1")]
)
def test_timeout_is_reported(
    address: str | None, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wait(*_: object) -> None:
        raise TimeoutError

    monkeypatch.setattr(parallel, "_client", lambda *_: contextlib.nullcontext())
    monkeypatch.setattr(parallel, "_require_same_files", wait)
    with refused(InputError, words, "did not answer in time", "same command"):
        list(run_tasks(abs, [1], workers=0 if address else 1, scheduler=address))


def test_error_at_the_end_of_workers_loses_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    close = LocalCluster.close

    def fail(cluster: LocalCluster, timeout: float) -> None:
        close(cluster, timeout)
        raise AssertionError

    monkeypatch.setattr(LocalCluster, "close", fail)
    assert [*run_tasks(abs, [-1], workers=1)] == [Outcome(-1, 1)]


def test_scheduler_without_workers_is_refused() -> None:
    empty = LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0")
    with empty, refused(InputError, "no workers", "dask worker"):
        list(run_tasks(abs, [1], scheduler=empty.scheduler_address))


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ((__version__, [None]), ("does not see", "share")),
        (("0.0.0", [0]), ("has semsig_gis 0.0.0", f"install {__version__}")),
        (None, ("cannot run semsig_gis", "No module named 'semsig_gis'", "install it")),
    ],
)
def test_worker_with_another_version_or_other_files_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cluster: LocalCluster,
    answer: tuple[object, ...] | None,
    words: tuple[str, ...],
) -> None:
    main_process = os.getpid()

    def version_and_sizes(paths: list[Path]) -> tuple[object, ...]:
        if os.getpid() == main_process:
            return __version__, [0 for _ in paths]
        if answer is None:
            raise ModuleNotFoundError("No module named 'semsig_gis'")
        return answer

    monkeypatch.setattr(parallel, "_version_and_sizes", version_and_sizes)
    with refused(InputError, "the worker tcp://127.0.0.1", *words):
        list(run_tasks(abs, [1], scheduler=cluster.scheduler_address, files=[tmp_path]))
