"""`python -m app` is `bewarenav`."""

from app.cli import main

main()
