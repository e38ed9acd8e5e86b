"""The engine that is always there: torch, batch norms folded, channels last in memory."""

from __future__ import annotations

from typing import Literal

import torch

from navcore.perception.esanet.inference.engine import Batch
from navcore.perception.esanet.network.batchnorm_folding import folded
from navcore.perception.esanet.network.model import EsaNet

Precision = Literal["f32", "bf16"]


class TorchInference:
    """Satisfies `Inference`. In f32 it is what every other engine is compared with."""

    def __init__(
        self, network: EsaNet, *, precision: Precision = "f32", threads: int | None = None
    ) -> None:
        """Works on a copy of the network, on its device. `threads` caps torch, and that is the
        whole process's torch."""
        self.name = f"torch {precision}"
        self._threads = threads
        self._type = torch.bfloat16 if precision == "bf16" else torch.float32
        self._device = next(network.parameters()).device
        self._network = folded(network).to(dtype=self._type, memory_format=torch.channels_last)  # type: ignore[call-overload]

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """As `Inference` says."""
        if self._threads is not None and torch.get_num_threads() != self._threads:
            torch.set_num_threads(self._threads)  # OpenMP keeps the number per calling thread
        with torch.inference_mode():
            colour, distance = (
                torch.from_numpy(batch).to(
                    self._device, self._type, memory_format=torch.channels_last
                )
                for batch in (rgb, depth)
            )
            answer: Batch = self._network(colour, distance).float().contiguous().cpu().numpy()
        return answer
