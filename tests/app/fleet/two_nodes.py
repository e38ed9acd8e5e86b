"""Proofs on a Ray cluster of two nodes on this machine: `python -m tests.app.fleet.two_nodes`."""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ray.cluster_utils import Cluster

from app.evaluation.campaign import HERE, Campaign, Fleet
from app.fleet.campaign_files import EPISODES
from app.fleet.ray_cluster import RayCluster
from tests.app.evaluation.test_campaign import alive, within_s

PATIENCE_S = 120.0
MEASURED = ("wall_time_s", "plan_ms", "tick_ms", "segment_ms")
"""Fields of a report that are real time."""


def node_loss(cluster: Cluster, doomed: Any, out: Path) -> None:
    """A node is killed while it drives: no episode is lost, and the other node drives the rest."""
    marks = out / "marks"
    marks.mkdir()
    killer = threading.Thread(target=_kill, args=(cluster, doomed, marks))
    killer.start()
    reports = campaign(marks).run(range(6), fleet=on(cluster), out=out / "ray")
    killer.join()
    tried = len(list(marks.glob("*-*")))
    assert tried > len(reports), "control: no episode was in progress on the node that was killed"
    alone = campaign(marks).run(range(6), fleet=HERE, out=out / "here")
    assert reports == alone
    lines = [sorted((out / name / EPISODES).read_text().splitlines()) for name in ("ray", "here")]
    assert lines[0] == lines[1]


def _kill(cluster: Cluster, doomed: Any, marks: Path) -> None:
    """Kill a node when it drives an episode; let the episodes end when its worker is gone."""
    within(lambda: any(marks.glob(f"*-{doomed.node_id}")))
    (mark, *_) = marks.glob(f"*-{doomed.node_id}")
    within(lambda: bool(mark.read_text()))
    cluster.remove_node(doomed, allow_graceful=False)
    within(lambda: not alive(int(mark.read_text())))
    (marks / "go").touch()


def within(holds: Callable[[], bool]) -> None:
    """Wait until something holds."""
    assert within_s(PATIENCE_S, holds)


def campaign(marks: Path) -> Campaign:
    """Return a campaign whose episodes wait until a node was killed."""
    drive = partial(_drive, marks=marks)
    return Campaign(
        suite="test", key="key", rules="rules", holds="others", drive=drive, drive_alone=drive
    )


def _drive(key: int, *, marks: Path) -> dict[str, Any]:
    import ray

    node = ray.get_runtime_context().get_node_id() if ray.is_initialized() else "here"
    (marks / f"{key}-{node}").write_text(str(os.getpid()))
    within((marks / "go").exists)
    return {"key": key, "success": True, "value": key / 7}


def episodes(cluster: Cluster, doomed: Any, out: Path) -> None:
    """Driven episodes and their figures are those of one process, to the digit."""
    from app.episode.task import Task
    from app.evaluation.driving.scenario import evaluate_scenario
    from navcore.mission.beware_list import default_beware_list
    from sim.scenario.load import load_scenario

    task = Task(scenario=load_scenario("empty_room"), random=True, max_time_s=2.0)
    for name, fleet in (("ray", on(cluster)), ("here", HERE)):
        evaluate_scenario(
            task, seeds=range(2), out=out / name, beware=default_beware_list(), fleet=fleet
        )
    reports = [_reports(out / name) for name in ("ray", "here")]
    assert reports[0] == reports[1]
    drawn = [sorted(path.name for path in (out / name).rglob("*.png")) for name in ("ray", "here")]
    assert drawn[0] == drawn[1] and len(drawn[0]) > 3


def _reports(out: Path) -> list[dict[str, Any]]:
    kept = [json.loads(line) for line in (out / EPISODES).read_text().splitlines()]
    own = [{key: one[key] for key in one if key not in MEASURED} for one in kept]
    return sorted(own, key=lambda report: int(report["seed"]))


def images(cluster: Cluster, doomed: Any, out: Path) -> None:
    """A rendered data set is that of one process, to the byte."""
    from typer.testing import CliRunner

    from app.cli.main import cli

    sizes = [
        "--train",
        "208",
        "--valid",
        "8",
        "--test",
        "0",
        "--size",
        "64x48",
    ]
    for name, where in (("ray", ["--engine", "ray", "--address", cluster.address]), ("here", [])):
        answer = CliRunner().invoke(cli, ["dataset", "render", str(out / name), *sizes, *where])
        assert answer.exit_code == 0, answer.output
    names = [
        sorted(path.relative_to(out / name) for path in (out / name).rglob("*.*"))
        for name in ("ray", "here")
    ]
    assert names[0] == names[1] and len(names[0]) > 400
    assert all(
        (out / "ray" / one).read_bytes() == (out / "here" / one).read_bytes() for one in names[0]
    )


def on(cluster: Cluster) -> Fleet:
    """Return a fleet of all nodes of a cluster."""
    return Fleet(engine=RayCluster(address=cluster.address))


PROOFS: dict[str, Callable[[Cluster, Any, Path], None]] = {
    "node_loss": node_loss,
    "episodes": episodes,
    "images": images,
}


def main() -> None:
    """Run the proof that the first argument names, in the folder of the second."""
    limits = {"num_cpus": 1, "object_store_memory": 100_000_000}
    head = {**limits, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    try:
        second = cluster.add_node(**limits)
        PROOFS[sys.argv[1]](cluster, second, Path(sys.argv[2]))
    finally:
        cluster.shutdown()


if __name__ == "__main__":
    main()
