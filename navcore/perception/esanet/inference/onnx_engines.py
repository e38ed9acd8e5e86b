"""Engines that run ONNX files: onnxruntime and OpenVINO. Neither is needed; both are faster than
torch."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from types import ModuleType
from typing import Any, Literal, cast

from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference.engine import THREADS, Batch
from navcore.perception.esanet.inference.onnx_file import INPUTS, OUTPUT

Precision = Literal["f32", "bf16", "int8"]
"""In int8 run networks that were exported in eight bits; what is not in them runs in bf16 where the
processor has it."""


class OnnxRuntimeInference:
    """Satisfies `Inference` on onnxruntime, in the precision of the file."""

    def __init__(self, content: bytes, *, threads: int = THREADS) -> None:
        """Raises `BadConfiguration` for a file that it cannot run."""
        self.name = "onnxruntime f32"
        try:
            import onnxruntime

            options = onnxruntime.SessionOptions()
            options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
            options.log_severity_level = 3
            # Between two layers a waiting thread sleeps: on two cores the command thread needs one
            # of them more than we do.
            options.add_session_config_entry("session.intra_op.allow_spinning", "0")
            self._session = onnxruntime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # a damaged file can make it fail in any way, a package that does not fit the machine too
            raise _bad("onnxruntime", error) from None
        _check_ports(
            {i.name for i in self._session.get_inputs()},
            {o.name for o in self._session.get_outputs()},
        )

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """As `Inference` says."""
        try:
            answer: Batch = self._session.run([OUTPUT], {"rgb": rgb, "depth": depth})[0]
        except Exception as error:
            raise _bad("onnxruntime", error) from None
        return answer


class OpenVinoInference:
    """Satisfies `Inference` on OpenVINO's CPU plugin."""

    def __init__(
        self, content: bytes, *, precision: Precision = "f32", threads: int = THREADS
    ) -> None:
        """Raises `BadConfiguration` for a file that it cannot run."""
        self.name = f"openvino {precision}"
        settings: dict[str, Any] = {
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            "PERFORMANCE_HINT": "LATENCY",
        }
        try:
            core = _openvino().Core()
            # Left to itself it takes bf16 wherever the processor has it, for an f32 that was asked
            # for too.
            settings["INFERENCE_PRECISION_HINT"] = (
                "f32" if precision == "f32" or not has_bf16() else "bf16"
            )
            compiled = core.compile_model(core.read_model(content), "CPU", settings)
            self._request = compiled.create_infer_request()
        except Exception as error:
            raise _bad("openvino", error) from None
        names = [
            {name for port in ports for name in port.get_names()}
            for ports in (compiled.inputs, compiled.outputs)
        ]
        _check_ports(*names)

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """As `Inference` says; the memory of the answer is used again by the next call."""
        try:
            answer: Batch = self._request.infer(
                {"rgb": rgb, "depth": depth}, share_inputs=True, share_outputs=True
            )[OUTPUT]
        except Exception as error:
            raise _bad("openvino", error) from None
        return answer


def is_installed(package: str) -> bool:
    """Whether an engine's package is there, without loading it."""
    return importlib.util.find_spec(package) is not None


def has_bf16() -> bool:
    """Whether OpenVINO has bf16 of this processor; False where it does not run at all."""
    try:
        return "BF16" in _openvino().Core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
    except (
        Exception
    ):  # a package that does not fit the machine; its engine says so when it is tried
        return False


def _openvino() -> Any:
    """The package `openvino`, which else would tell its maker over the network that it was
    imported."""
    # A package that cannot be imported, as far as Python knows; OpenVINO then takes a stub of its
    # own, which sends nothing.
    sys.modules.setdefault("openvino_telemetry", cast(ModuleType, None))
    return importlib.import_module("openvino")


def _check_ports(inputs: set[str], outputs: set[str]) -> None:
    if inputs != set(INPUTS) or OUTPUT not in outputs:
        raise BadConfiguration(
            f"the ONNX file takes {', '.join(sorted(inputs))} and answers {', '.join(sorted(outputs))}; "
            f"expected {', '.join(INPUTS)} and {OUTPUT}"
        )


def _bad(engine: str, error: Exception) -> BadConfiguration:
    # OpenVINO says first where in its source it stumbled, line by line, and last what over.
    lines = [
        line.strip()
        for line in str(error).splitlines()
        if line.strip() and not line.startswith("Exception from")
    ]
    return BadConfiguration(
        f"{engine} cannot run the network: {lines[-1] if lines else error!r:.300}"
    )
