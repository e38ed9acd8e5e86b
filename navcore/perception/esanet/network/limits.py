"""What an ESANet takes and answers, for those that handle it without torch."""

from __future__ import annotations

STRIDE = 32
"""Height and width must be multiples of this, or the decoder's maps would not fit the skips."""
MAX_CLASSES = 255
"""Largest number of classes: class ids are bytes."""
