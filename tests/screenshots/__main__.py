"""`python -m tests.screenshots take|check|pictures`: renew the reference screenshots of the page,
compare the page with them, or renew the pictures of the READMEs."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import typer
from PIL import Image

from tests.screenshots.compare import changed_tiles, looks_alike, marked
from tests.screenshots.pictures import take_pictures
from tests.screenshots.take import take

REFERENCES = Path(__file__).parent / "references"


def check(out: Path) -> list[str]:
    """Compare the page with its references; returns a line for each screenshot that differs, and
    writes it to `out` with the rest of the screen faded."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        files = {file.name: file for file in take(Path(folder))}
        kept = {file.name for file in REFERENCES.glob("*.webp")}
        found += [f"{name}: has no reference" for name in sorted(files.keys() - kept)]
        found += [f"{name}: is no longer a state" for name in sorted(kept - files.keys())]
        for name in sorted(files.keys() & kept):
            reference, current = (read(place / name) for place in (REFERENCES, Path(folder)))
            changed = changed_tiles(reference, current)
            if not looks_alike(changed):
                out.mkdir(parents=True, exist_ok=True)
                shown = out / f"{Path(name).stem}.png"
                Image.fromarray(np.hstack([reference, marked(current, changed)])).save(shown)
                found.append(f"{name}: {changed.mean():.1%} of the screen differs, see {shown}")
    return found


def read(file: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    with Image.open(file) as image:
        return np.asarray(image.convert("RGB"), dtype=np.uint8)


def main(arguments: list[str]) -> int:
    """Run one of the three commands; returns the exit code."""
    if arguments == ["take"]:
        files = take(REFERENCES)
        size_mb = sum(file.stat().st_size for file in files) / 1e6
        typer.echo(f"{len(files)} screenshots, {size_mb:.2f} MB, are in {REFERENCES}")
        return 0
    if arguments == ["check"]:
        found = check(Path("runs") / "screenshots")
        typer.echo("\n".join(found) or "The page looks as its references do.")
        return int(bool(found))
    if arguments == ["pictures"]:
        for file in take_pictures():
            typer.echo(f"{file}: {file.stat().st_size / 1e6:.2f} MB")
        return 0
    typer.echo(__doc__, err=True)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
