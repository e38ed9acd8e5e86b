"""Persistent storage: one SQLite file (WAL, synchronous FULL) that survives restarts and `kill -9`.
`Store` is its interface."""

from app.storage.store import Store as Store
