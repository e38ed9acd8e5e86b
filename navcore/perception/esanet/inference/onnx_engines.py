"""Engines for ONNX files: onnxruntime and OpenVINO, both optional and faster than torch."""

from __future__ import annotations

import copy
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, cast

from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference.engine import THREADS, Batch
from navcore.perception.esanet.inference.onnx_file import FEATURES, INPUTS, OUTPUT

Precision = Literal["f32", "bf16", "int8"]
"""Precision of the arithmetic; `int8` is for networks exported in eight bits, whose other layers
run in bf16 where the processor has it."""


class OnnxRuntimeInference:
    """`Inference` on onnxruntime, in the precision of the file."""

    def __init__(self, content: bytes, *, threads: int = THREADS) -> None:
        """Load an ONNX file; raises `BadConfiguration` if it cannot be run."""
        self.name = "onnxruntime f32"
        try:
            import onnxruntime

            options = onnxruntime.SessionOptions()
            options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
            options.log_severity_level = 3
            # Waiting threads sleep between layers: on two cores the command thread needs one.
            options.add_session_config_entry("session.intra_op.allow_spinning", "0")
            self._session = onnxruntime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            # A damaged file or a package that does not fit the machine can raise anything.
            raise _bad("onnxruntime", error) from None
        _check_ports(
            {i.name for i in self._session.get_inputs()},
            outputs := {o.name for o in self._session.get_outputs()},
        )
        self.has_features = FEATURES in outputs

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """Run the network as `Inference` specifies."""
        return self._run([OUTPUT], rgb, depth)[0]

    def for_another_thread(self) -> OnnxRuntimeInference:
        """Return itself: sessions can be run by any thread."""
        return self

    def logits_and_features(self, rgb: Batch, depth: Batch) -> tuple[Batch, Batch]:
        """Run the network as `Inference` specifies."""
        logits, features = self._run([OUTPUT, FEATURES], rgb, depth)
        return logits, features

    def _run(self, outputs: list[str], rgb: Batch, depth: Batch) -> list[Batch]:
        try:
            answer: list[Batch] = self._session.run(outputs, {"rgb": rgb, "depth": depth})
        except Exception as error:
            raise _bad("onnxruntime", error) from None
        return answer


class OpenVinoInference:
    """`Inference` on OpenVINO's CPU plugin."""

    def __init__(
        self,
        content: bytes,
        *,
        precision: Precision = "f32",
        threads: int = THREADS,
        compiled: Path | None = None,
    ) -> None:
        """Load an ONNX file; raises `BadConfiguration` if it cannot be run.

        `compiled`: folder in which OpenVINO keeps what it compiled and finds it again. A file there
        that is damaged is compiled once more, and a folder that cannot be used is not.
        """
        self.name = f"openvino {precision}"
        settings: dict[str, Any] = {
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            "PERFORMANCE_HINT": "LATENCY",
        }
        try:
            core = _openvino().Core()
            # By default OpenVINO uses bf16 wherever the processor has it, even for f32 networks.
            settings["INFERENCE_PRECISION_HINT"] = (
                "f32" if precision == "f32" or not has_bf16() else "bf16"
            )
            model = core.read_model(content)
            try:
                kept = {} if compiled is None else {"CACHE_DIR": str(compiled)}
                self._compiled = core.compile_model(model, "CPU", settings | kept)
            except RuntimeError:  # of the folder, or of the network, which then fails again
                self._compiled = core.compile_model(model, "CPU", settings)
            self._request = self._compiled.create_infer_request()
        except Exception as error:
            raise _bad("openvino", error) from None
        names = [
            {name for port in ports for name in port.get_names()}
            for ports in (self._compiled.inputs, self._compiled.outputs)
        ]
        _check_ports(*names)
        self.has_features = FEATURES in names[1]

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """Run the network as `Inference` specifies; the next call reuses the memory of the
        logits."""
        return self._run(rgb, depth, OUTPUT)[0]

    def for_another_thread(self) -> OpenVinoInference:
        """Return the network with memory of its own for inputs and outputs."""
        other = copy.copy(self)
        other._request = self._compiled.create_infer_request()
        return other

    def logits_and_features(self, rgb: Batch, depth: Batch) -> tuple[Batch, Batch]:
        """Run the network as `Inference` specifies; the next call reuses the memory of both."""
        logits, features = self._run(rgb, depth, OUTPUT, FEATURES)
        return logits, features

    def _run(self, rgb: Batch, depth: Batch, *outputs: str) -> list[Batch]:
        try:
            answers = self._request.infer(
                {"rgb": rgb, "depth": depth}, share_inputs=True, share_outputs=True
            )
            return [answers[name] for name in outputs]
        except Exception as error:
            raise _bad("openvino", error) from None


def is_installed(package: str) -> bool:
    """Return whether a package is installed, without importing it."""
    return importlib.util.find_spec(package) is not None


def has_bf16() -> bool:
    """Return whether OpenVINO supports bf16 on this processor; False if it does not run."""
    try:
        return "BF16" in _openvino().Core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
    except Exception:  # a package that does not fit the machine; its engine reports the reason
        return False


def _openvino() -> Any:
    """Import `openvino` without its telemetry."""
    # None marks the telemetry package as not importable; OpenVINO then uses a stub that sends
    # nothing.
    sys.modules.setdefault("openvino_telemetry", cast(ModuleType, None))
    return importlib.import_module("openvino")


def _check_ports(inputs: set[str], outputs: set[str]) -> None:
    if inputs != set(INPUTS) or OUTPUT not in outputs:
        raise BadConfiguration(
            f"the ONNX file takes {', '.join(sorted(inputs))} and answers "
            f"{', '.join(sorted(outputs))}; expected {', '.join(INPUTS)} and {OUTPUT}"
        )


def _bad(engine: str, error: Exception) -> BadConfiguration:
    # OpenVINO's message starts with lines about its source; the last line is the reason.
    lines = [
        line.strip()
        for line in str(error).splitlines()
        if line.strip() and not line.startswith("Exception from")
    ]
    return BadConfiguration(
        f"{engine} cannot run the network: {lines[-1] if lines else error!r:.300}"
    )
