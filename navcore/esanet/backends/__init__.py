"""Engines that run a trained network: torch, which is always there, onnxruntime and OpenVINO where they are installed."""
