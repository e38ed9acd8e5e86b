"""Tasks are done once each, whatever is lost, and come back as values."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Collection, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any

import pytest

from app.fleet import local
from app.fleet.engine import MACHINE_LOSSES, TRIES, Done, Lost, in_order, run
from app.fleet.local import ThisProcess
from app.fleet.ray_cluster import RayCluster
from app.fleet.shard import Shard, parse_shard
from app.runtime.record.provenance import version
from navcore.errors import BadConfiguration


class Unreliable:
    """An engine that loses some tasks so many times, and ends the last submitted one first."""

    alone = False

    def __init__(self, losses: dict[int, int], *, machine: bool) -> None:
        self.losses, self.machine, self.running, self.most = losses, machine, 0, 0

    @contextmanager
    def started(self) -> Iterator[Unreliable]:
        self.running += 1
        yield self
        self.running -= 1

    def submit(self, do: Any, task: Any) -> tuple[Any, int, object]:
        return (do, task, object())

    def ended(self, handles: Collection[Any]) -> list[Any]:
        self.most = max(self.most, len(handles))
        return [list(handles)[-1]]

    def outcome(self, handle: Any) -> Done[Any] | Lost:
        do, task, _ = handle
        if self.losses.get(task, 0):
            self.losses[task] -= 1
            return Lost(cause="gone", machine=self.machine)
        return Done(result=do(task), node="here", pid=1)


def square(number: int) -> int:
    return number * number


@pytest.mark.parametrize(("machine", "tries"), [(False, TRIES), (True, MACHINE_LOSSES)])
def test_a_lost_task_is_done_again_and_given_up_only_in_the_end(machine: bool, tries: int) -> None:
    engine = Unreliable({1: tries - 1, 2: tries}, machine=machine)
    outcomes = dict(run(engine, square, range(4)))
    assert {task for task, outcome in outcomes.items() if isinstance(outcome, Lost)} == {2}
    assert [outcomes[task].result for task in (0, 1, 3)] == [0, 1, 9]  # type: ignore[union-attr]
    assert engine.running == 0


@pytest.mark.parametrize("engine", [ThisProcess(), Unreliable({3: 1}, machine=False)])
def test_results_come_in_the_order_of_the_tasks_and_few_wait_for_their_turn(engine: Any) -> None:
    assert list(in_order(engine, square, range(20), ahead=4)) == [n * n for n in range(20)]
    assert isinstance(engine, ThisProcess) or engine.most == 4


def test_a_timeout_within_a_task_is_its_error_and_no_worker_that_hangs() -> None:
    def ask_simulator(task: int) -> None:
        raise TimeoutError("the simulator did not answer")

    pool = local._Pool(pool=None, limit_s=9.0, expected=version())  # type: ignore[arg-type]
    failed, hanging = Future[Any](), Future[Any]()
    failed.set_result(pickle.loads(pickle.dumps(local._checked(ask_simulator, 1, version()))))
    hanging.set_exception(TimeoutError())
    with pytest.raises(TimeoutError, match="the simulator did not answer") as raised:
        pool.outcome(failed)
    assert "in ask_simulator" in "".join(raised.value.__notes__)
    assert pool.outcome(hanging) == Lost(cause="it took longer than 9 s")


def test_shares_are_even_and_together_the_whole() -> None:
    keys = list(range(3000, 3010))
    shares = [Shard(index, 4).of(keys) for index in (1, 2, 3, 4)]
    assert sorted(key for share in shares for key in share) == keys
    assert {len(share) for share in shares} == {2, 3}
    assert parse_shard("2/8") == Shard(2, 8) and str(Shard(2, 8)) == "2/8"


@pytest.mark.parametrize("text", ["", "2", "0/4", "5/4", "1/0", "a/b", "-1/4", "1/4/2"])
def test_a_share_that_does_not_exist_is_refused(text: str) -> None:
    with pytest.raises(BadConfiguration, match="--shard"):
        parse_shard(text)


def test_without_ray_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(BadConfiguration, match=r"pip install -e '\.\[fleet\]'"):
        list(run(RayCluster(), square, [1]))


@pytest.mark.parametrize("address", ["127.0.0.1:1", "127.0.0.1:99999"])
def test_an_address_without_a_cluster_is_refused_at_once(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", object())
    with pytest.raises(BadConfiguration, match=f"no Ray cluster at '{address}'"):
        list(run(RayCluster(address=address), square, [1]))
