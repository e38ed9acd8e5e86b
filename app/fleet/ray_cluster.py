"""Tasks on the machines of a Ray cluster. Ray is an optional package, imported at the start."""

from __future__ import annotations

import faulthandler
import os
import platform
import socket
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from app.fleet.engine import Done, Lost
from app.fleet.local import LIMIT_S, check_version
from app.runtime.record.provenance import version
from navcore.errors import BadConfiguration

STORE_BYTES = 200_000_000
"""Memory for results that were not fetched yet, of a cluster that is started here."""

CONNECT_S = 10.0
"""Time within which the head of a cluster must accept a connection, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RayCluster:
    """Workers of a Ray cluster, one a CPU; a worker or machine that is lost loses no task.

    Each machine needs the same version of this package and, if weights are chosen by their file,
    that file at the same path. Tasks and results travel as values.
    """

    address: str | None = None
    """Address of the cluster, e.g. `10.0.0.5:6379` or `auto`; None for one on this machine."""
    workers: int = 1
    """Number of workers of a cluster that is started here."""
    limit_s: float = LIMIT_S
    """Real time after which a task counts as hung, seconds."""
    alone = False

    @contextmanager
    def started(self) -> Iterator[_Cluster]:
        """Join or start the cluster; raises `BadConfiguration` where that is not possible."""
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ImportError:
            raise BadConfiguration(
                "the engine ray needs the package ray: run .venv/bin/pip install -e '.[fleet]'"
            ) from None
        if self.address:
            _check_reachable(self.address)
        here = (
            {} if self.address else {"num_cpus": self.workers, "object_store_memory": STORE_BYTES}
        )
        try:
            ray.init(
                address=self.address or "local",
                include_dashboard=None if self.address else False,
                log_to_driver=False,
                logging_level="ERROR",
                **here,
            )
        except (ConnectionError, ValueError, RuntimeError) as error:
            where = f"no Ray cluster at {self.address!r}" if self.address else "Ray does not start"
            raise BadConfiguration(f"{where}: {error}") from None
        try:
            remote = ray.remote(num_cpus=1, max_retries=0)(_done)
            yield _Cluster(ray, remote, self.limit_s)
        finally:
            ray.shutdown()


@dataclass(frozen=True, slots=True)
class _Cluster:
    ray: Any
    remote: Any
    limit_s: float

    def submit(self, do: Callable[[Any], Any], task: Any) -> Any:
        return self.remote.remote(do, task, limit_s=self.limit_s, expected=version())

    def ended(self, handles: Collection[Any]) -> list[Any]:
        ready: list[Any] = self.ray.wait(list(handles), num_returns=1)[0]
        return ready

    def outcome(self, handle: Any) -> Done[Any] | Lost:
        errors = self.ray.exceptions
        try:
            done: Done[Any] = self.ray.get(handle)
        except errors.RayTaskError as error:
            raise error.cause from None
        except errors.WorkerCrashedError:
            return Lost(cause=f"its worker was killed, or it took longer than {self.limit_s:g} s")
        except errors.OutOfMemoryError:
            return Lost(cause="its machine was short of memory")
        except (errors.NodeDiedError, errors.ObjectLostError) as error:
            return Lost(cause=f"its machine was lost ({type(error).__name__})", machine=True)
        return done


def _check_reachable(address: str) -> None:
    """Raise `BadConfiguration` where nothing listens; Ray itself tries for minutes."""
    host, _, port = address.rpartition(":")
    if not port.isdecimal() or "/" in host:
        return
    try:
        socket.create_connection((host, int(port)), timeout=CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise BadConfiguration(f"no Ray cluster at {address!r}: {error}") from None


def _done(do: Callable[[Any], Any], task: Any, *, limit_s: float, expected: str) -> Done[Any]:
    """Do a task in a worker of the cluster; a task that hangs ends its worker."""
    import ray

    check_version(expected)
    node = f"{platform.node()}:{ray.get_runtime_context().get_node_id()[:6]}"
    faulthandler.dump_traceback_later(limit_s, exit=True, file=sys.__stderr__ or sys.stderr)
    try:
        return Done(result=do(task), node=node, pid=os.getpid())
    finally:
        faulthandler.cancel_dump_traceback_later()
