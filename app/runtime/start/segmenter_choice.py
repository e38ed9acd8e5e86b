"""The operator's choice of the segmenter. Imports no slow package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from navcore.robot.camera_stream import CameraStream

Kind = Literal["auto", "network", "colour"]
Backend = Literal["auto", "torch", "onnxruntime", "openvino", "openvino-bf16", "openvino-int8"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterChoice:
    """Options of the segmenter."""

    kind: Kind = "auto"
    """`auto`: the network if its weights are present and valid, else the colour rules with a
    warning."""
    weights: Path | None = None
    """Weights, a `.safetensors` or `.onnx` file; None for the shipped ones."""
    engine: str = "auto"
    """Inference engine; `auto` measures the installed ones. f32 unless a precision is given, e.g.
    `openvino bf16`."""
    measured: bool = False
    """Whether an engine that is named is measured as all are with `auto`, and refused where it
    decides otherwise than torch in f32."""
    live: bool = False
    """Whether it must keep up with real time: smaller images if no engine is fast enough."""
    smaller: bool = False
    """Whether smaller images than in training are used; chosen by measuring, as the engine."""
    camera: tuple[int, int] = CameraStream().size
    """Columns and rows of the camera's images; weights without a working size of their own use the
    nearest one."""
    threads: int = 2
    """Number of CPU threads of the engine."""
