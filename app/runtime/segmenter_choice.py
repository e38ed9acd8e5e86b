"""What an operator may say about the segmenter, and the command-line options for it. Imports
nothing that takes a second."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

Kind = Literal["auto", "network", "colour"]
Backend = Literal["auto", "torch", "onnxruntime", "openvino", "openvino-bf16", "openvino-int8"]
KindOption = Annotated[
    Kind,
    typer.Option(
        "--segmenter", help="The network, the colour rules alone, or the network where it runs."
    ),
]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        "--weights",
        metavar="FILE.safetensors|FILE.onnx",
        help="A network other than the shipped one.",
    ),
]
BackendOption = Annotated[
    Backend,
    typer.Option(
        "--backend",
        help="What runs the network; `auto` takes what is fast here. `torch` is the same to the last bit.",
    ),
]


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
