"""Figures of the benchmark of light as they stand in tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def row_of(measured: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the figures of one disturbance as the cells of a table."""
    few, many = measured["false_items_per_10_m_ci95"]
    return (
        f"{measured['mean_iou']:.3f}",
        f"{measured['found']} of {measured['things_in_view']}",
        measured.get("found_of_thin", "–"),
        f"{measured['false_items_per_10_m']:.2f} ({few:.2f} to {many:.2f})",
    )
