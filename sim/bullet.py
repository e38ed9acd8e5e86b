"""PyBullet, imported without the line that it prints then; every other module takes it from
here."""

from __future__ import annotations

from sim.quiet import quiet_output

with quiet_output():
    import pybullet

__all__ = ["pybullet"]
