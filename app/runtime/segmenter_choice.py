"""The operator's choice of the segmenter. Imports no slow package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Kind = Literal["auto", "network", "colour"]
Backend = Literal["auto", "torch", "onnxruntime", "openvino", "openvino-bf16", "openvino-int8"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterChoice:
    """What the operator asked for."""

    kind: Kind = "auto"
    """`auto` takes the network if its weights are there and whole, else the colour rules, and says
    so."""
    weights: Path | None = None
    """A `.safetensors` or `.onnx` file; None for the one that comes with the package."""
    engine: str = "auto"
    """`auto` tries those that are installed; else an engine, in f32 unless it says otherwise, e.g.
    `openvino bf16`."""
    live: bool = False
    """Whether the world does not wait for it: where no engine is quick enough, it is shown smaller
    pictures."""
    smaller: bool = False
    """Whether it is shown smaller pictures than it was trained on; found by trying, as the engine.
    """
    threads: int = 2
    """That it may use."""
