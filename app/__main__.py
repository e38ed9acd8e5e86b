"""Entry point: `python -m app` is `bewarenav`."""

from app.cli.main import main

main()
