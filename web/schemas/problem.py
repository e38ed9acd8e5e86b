"""Shape of every refusal."""

from __future__ import annotations

from pydantic import BaseModel

from web.interface.wire import DOCUMENTED


class ProblemBody(BaseModel):
    """Refusal in the console's own words."""

    model_config = DOCUMENTED

    code: str
    """Stable word for programs."""
    message: str
    """Sentence for people."""
    where: str | None
    """Part of the request that is refused; null for the whole."""


class Problem(BaseModel):
    """Refusal, also in the fields of RFC 9457."""

    model_config = DOCUMENTED

    type: str
    """URI of the kind of problem; `about:blank`, because `error.code` says more."""
    title: str
    """Phrase of the HTTP status."""
    status: int
    """HTTP status."""
    detail: str
    """Sentence for people; equals `error.message`."""
    error: ProblemBody
    """Refusal in the console's own words."""
