"""Archives of very many entries are refused before their directory is read."""

from __future__ import annotations

import io
import zipfile

import pytest

from navcore.errors import BadConfiguration
from navcore.learning.data import zip_archive
from navcore.learning.data.zip_archive import END, END_MARK, open_zip


def packed(entries: int, comment: bytes = b"") -> bytes:
    """Return an archive of empty files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for number in range(entries):
            archive.writestr(f"{number}.txt", b"")
        archive.comment = comment
    return content.getvalue()


def told(archive: bytes, entries: int) -> bytes:
    """Return the archive with another number of entries in the record at its end."""
    at = archive.rfind(END_MARK)
    mark, disk, begin, _, _, size_bytes, place, comment = END.unpack_from(archive, at)
    record = END.pack(mark, disk, begin, entries, entries, size_bytes, place, comment)
    return archive[:at] + record + archive[at + END.size :]


@pytest.fixture
def zip64(monkeypatch: pytest.MonkeyPatch) -> bytes:
    """An archive of four entries whose ordinary record tells as little as with very many."""
    monkeypatch.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 1)
    return told(packed(4), 0)


def refused(archive: bytes, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the sentence by which an archive is refused before it is opened."""
    with monkeypatch.context() as patched:
        patched.setattr(zipfile, "ZipFile", None)
        with pytest.raises(BadConfiguration) as error:
            open_zip(io.BytesIO(archive), "the archive")
    return str(error.value)


def test_too_many_entries_are_refused_before_the_directory_is_read(
    zip64: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zip_archive, "MAX_ENTRIES", 3)
    for archive in (packed(4), packed(4, b"a comment"), b"before it" + packed(4), zip64):
        said = refused(archive, monkeypatch)
        assert said == "the archive: 4 entries, at most 3 are read"
    open_zip(io.BytesIO(packed(3)), "the archive").close()


def test_a_large_directory_is_refused_whatever_number_of_entries_is_told(
    zip64: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zip_archive, "MAX_DIRECTORY_BYTES", 100)
    for archive in (told(packed(4), 1), zip64):
        assert "the list of its files has 204 bytes, at most 100" in refused(archive, monkeypatch)


def test_more_entries_than_are_told_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zip_archive, "MAX_ENTRIES", 3)
    with pytest.raises(BadConfiguration, match="4 entries, at most 3"):
        open_zip(io.BytesIO(told(packed(4), 1)), "the archive")


@pytest.mark.parametrize("content", [b"", b"PK\5\6", b"no archive at all, but long enough"])
def test_what_is_no_archive_is_told_as_by_zipfile(content: bytes) -> None:
    with pytest.raises(zipfile.BadZipFile):
        open_zip(io.BytesIO(content), "the archive")
