"""The processes that train one network together: who this one is, and how their figures become one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
import torch.distributed as group
from torch import nn


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranks:
    """This process among those of the run; whoever starts them has set up torch's process group
    before."""

    rank: int = 0
    """Number of this process. The first one alone writes files."""
    count: int = 1
    """Processes of the run."""

    @property
    def first(self) -> bool:
        """Whether this process writes the files."""
        return self.rank == 0

    def summed(self, values: npt.NDArray[np.int64], device: torch.device) -> npt.NDArray[np.int64]:
        """The element-wise sum over all processes."""
        if self.count == 1:
            return values
        tensor = torch.from_numpy(values.copy()).to(device)
        group.all_reduce(tensor)
        return tensor.cpu().numpy()

    def mean(self, value: float, device: torch.device) -> float:
        """The mean over all processes."""
        if self.count == 1:
            return value
        tensor = torch.tensor(value, dtype=torch.float64, device=device)
        group.all_reduce(tensor)
        return float(tensor) / self.count

    def average_buffers(self, network: nn.Module) -> None:
        """Make the running means of the batch norms, which each process has of its own pictures,
        the same everywhere."""
        if self.count == 1:
            return
        for buffer in network.buffers():
            if buffer.is_floating_point():
                group.all_reduce(buffer)
                buffer /= self.count

    def wait(self) -> None:
        """Until all processes have come here."""
        if self.count > 1:
            group.barrier()
