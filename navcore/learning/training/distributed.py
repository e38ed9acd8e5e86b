"""Distributed training: this process among those of the run, and reductions over all of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
import torch.distributed as group
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranks:
    """This process among those of the run; torch's process group must be initialised."""

    rank: int = 0
    """Index of this process; only process 0 writes files."""
    count: int = 1
    """Number of processes of the run."""

    @property
    def first(self) -> bool:
        """Return whether this process writes the files."""
        return self.rank == 0

    def summed(self, values: npt.NDArray[np.int64], device: torch.device) -> npt.NDArray[np.int64]:
        """Return the element-wise sum over all processes."""
        if self.count == 1:
            return values
        tensor = torch.from_numpy(values.copy()).to(device)
        group.all_reduce(tensor)
        return tensor.cpu().numpy()

    def mean(self, value: float, device: torch.device) -> float:
        """Return the mean over all processes."""
        if self.count == 1:
            return value
        tensor = torch.tensor(value, dtype=torch.float64, device=device)
        group.all_reduce(tensor)
        return float(tensor) / self.count

    def average(self, tensors: Iterable[Tensor]) -> None:
        """Replace floating-point tensors by their means over all processes, in place."""
        if self.count == 1:
            return
        for tensor in tensors:
            if tensor.is_floating_point():
                group.all_reduce(tensor)
                tensor /= self.count

    def wait(self) -> None:
        """Wait until all processes have called this."""
        if self.count > 1:
            group.barrier()
