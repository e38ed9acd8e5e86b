"""What must survive a restart or a `kill -9`: one SQLite file, WAL, synchronous FULL. `Store` is
its door."""

from app.storage.store import Store as Store
