"""Archives that are downloaded."""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Iterator
from typing import BinaryIO
from urllib.parse import quote

from fastapi.responses import StreamingResponse
from starlette.types import Message, Send

PART_BYTES = 1 << 16
"""Size of the parts in which an archive is sent, so small that a slow client takes one in time."""
STALL_S = 30.0
"""Longest time in which a client takes no part, seconds."""
log = logging.getLogger(__name__)


class Archive(StreamingResponse):
    """A file that is sent in parts and closed at the end, also where the client takes none for
    `STALL_S`: a connection whose other end is gone may stay open for hours."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        size = file.seek(0, os.SEEK_END)
        headers = {
            # By RFC 6266, as a name may have letters that a header has not.
            "Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}",
            "Content-Length": str(size),
        }
        file.seek(0)
        self._file = file
        super().__init__(_parts(file, size), media_type="application/zip", headers=headers)

    async def stream_response(self, send: Send) -> None:
        """Send the parts; ends where one is not taken in time, and the server cuts the answer
        off."""

        async def send_in_time(message: Message) -> None:
            async with asyncio.timeout(STALL_S):
                await send(message)

        try:
            await super().stream_response(send_in_time)
        except TimeoutError:
            log.warning("an export ends: its client has taken no part within %g s", STALL_S)
        finally:
            # Shielded: where the client has gone, this task is cancelled.
            await asyncio.shield(asyncio.to_thread(self._file.close))


def _parts(file: BinaryIO, size: int) -> Iterator[bytes]:
    """Yield the parts of a file of a size in bytes. It is closed before the last one goes out:
    a client that has that may ask for the next archive."""
    while size > 0 and (part := file.read(PART_BYTES)):
        size -= len(part)
        if size <= 0:
            file.close()
        yield part
