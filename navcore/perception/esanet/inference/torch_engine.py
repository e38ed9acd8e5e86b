"""The default engine: torch, batch norms folded, channels last in memory."""

from __future__ import annotations

from typing import Literal

import torch

from navcore.perception.esanet.inference.engine import Batch
from navcore.perception.esanet.network.batchnorm_folding import folded
from navcore.perception.esanet.network.model import EsaNet

Precision = Literal["f32", "bf16"]


class TorchInference:
    """`Inference` on torch; in f32 the reference for all other engines."""

    def __init__(
        self, network: EsaNet, *, precision: Precision = "f32", threads: int | None = None
    ) -> None:
        """Copy the network on its device; `threads` limits torch in the whole process."""
        self.name = f"torch {precision}"
        self._threads = threads
        self._type = torch.bfloat16 if precision == "bf16" else torch.float32
        self._device = next(network.parameters()).device
        self._network = folded(network).to(dtype=self._type, memory_format=torch.channels_last)  # type: ignore[call-overload]

    @property
    def has_features(self) -> bool:
        """Always."""
        return True

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """Run the network as `Inference` specifies."""
        return self.logits_and_features(rgb, depth)[0]

    def for_another_thread(self) -> TorchInference:
        """Return itself: it holds nothing between two calls."""
        return self

    def logits_and_features(self, rgb: Batch, depth: Batch) -> tuple[Batch, Batch]:
        """Run the network as `Inference` specifies."""
        if self._threads is not None and torch.get_num_threads() != self._threads:
            torch.set_num_threads(self._threads)  # OpenMP keeps the number per calling thread
        with torch.inference_mode():
            colour, distance = (
                torch.from_numpy(batch).to(
                    self._device, self._type, memory_format=torch.channels_last
                )
                for batch in (rgb, depth)
            )
            logits, features = (
                answer.float().contiguous().cpu().numpy()
                for answer in self._network.with_features(colour, distance)
            )
        return logits, features
