"""A receiver that hangs neither holds the sender up nor fills the memory."""

from __future__ import annotations

import multiprocessing

from app.runtime.message_queue import MAX_WAITING, LatestMessageQueue

MESSAGE = bytes(1_000_000)
"""More than a pipe holds, so that the sender's thread hangs in it."""


def test_messages_to_a_receiver_that_hangs_are_dropped_but_the_newest_under_each_key() -> None:
    receiver, sender = multiprocessing.Pipe(duplex=False)
    queue = LatestMessageQueue(sender, "test of a receiver that hangs")
    queue.post("first", MESSAGE)
    assert receiver.poll(10.0)
    for number in range(3 * MAX_WAITING):
        queue.post(str(number), b"")
        queue.post("command", str(number).encode())
    received: list[bytes] = []
    while not received or received[-1] != str(3 * MAX_WAITING - 1).encode():
        received.append(receiver.recv_bytes())
    assert len([message for message in received if message == b""]) <= MAX_WAITING
    assert len([message for message in received if message not in (b"", MESSAGE)]) <= 2
    receiver.close()
    queue.close()
