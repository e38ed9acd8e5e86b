"""Site archives: one zip of a JSON document and a map file, never pickled.

An archive comes from anywhere: its names are compared, not used as paths, sizes are bounded before
anything is unpacked, and the document is validated as a request of the API is.
"""

from __future__ import annotations

import dataclasses
import io
import json
import tempfile
import uuid
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from app.console.mission.path_settings import SETTINGS, stored_unknown_price
from app.console.mission.saved_missions import MISSIONS
from app.console.mission.zone_editor import SETS
from app.console.site.placing import poses_of_file, zones_on
from app.console.site.site_map import ACCEPTED, accepted_map, cell_map_of, cell_map_record
from app.storage.records import goal_of, goal_record, zone_of, zone_record
from app.storage.site_store import MAP_FILE, SiteStore
from navcore.errors import BadConfiguration
from navcore.geometry.transform import wrap_angle
from navcore.mapping.changes import CellMap
from navcore.mapping.storage import map_file
from navcore.mission.anchor import NumberedPoses
from navcore.mission.anchors import placed
from navcore.mission.beware_list import BewareList, as_table, default_beware_list
from navcore.mission.zone import Zone, check_polygon, check_rules
from navcore.mission.zone_shapes import still_drawn
from web.gateway.sentences import first_sentence
from web.interface.drafts import ZoneDraft
from web.interface.sites import MAX_ARCHIVE_BYTES
from web.schemas.sites import BewareDocument, SiteDocument
from web.schemas.zones import ImportedFeatureIn, ZoneOut

DOCUMENT = "site.json"
FURNISHINGS = ("site", "furnishings")
"""Kind and name of the stored document with dock and tags."""
MAX_DOCUMENT_BYTES = 32_000_000
"""Largest document in bytes, unpacked."""
MAX_MAP_PARTS_BYTES = 1 << 29
"""Largest total of the unpacked parts of the map file, in bytes."""
_READ = TypeAdapter(SiteDocument)
_FAILURES = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, OSError)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class SiteContents:
    """Checked contents of an archive."""

    zones: tuple[Zone, ...]
    """Zones with new ids."""
    documents: tuple[tuple[str, str, Any], ...]
    """(kind, name, JSON) of zone sets, missions, furnishings, settings and the accepted map."""
    beware: BewareList | None
    """Beware list; None for that of the package."""
    map_data: bytes | None
    """Map file; None without a map."""

    def store(self, site: SiteStore) -> None:
        """Write everything but the map into a new site."""
        site.change_zones(self.zones, [])
        for kind, name, value in self.documents:
            site.save_document(kind, name, value)
        if self.beware is not None:
            site.save_beware(self.beware)


def pack(site: SiteStore) -> bytes:
    """Return the archive of a site as it is at one moment; raises `NotKnown` where it has been
    deleted."""
    # Before the rest, so that the beware list has every class of the map.
    map_data = site.map_data(at_most=MAX_ARCHIVE_BYTES)
    poses = poses_of_file(map_data, MAP_FILE)
    with site.reading():
        document = _document(site, poses)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(DOCUMENT, json.dumps(document, allow_nan=False))
        if map_data is not None:
            packed.writestr(MAP_FILE, map_data, zipfile.ZIP_STORED)  # it is compressed itself
    return file.getvalue()


def _document(site: SiteStore, poses: NumberedPoses) -> dict[str, Any]:
    beware, accepted, furnished = site.beware(), accepted_map(site), furnishings_of(site)
    if (dock := furnished["dock"]) is not None:
        # Earlier versions stored any heading, and a document holds no more than some turns.
        furnished["dock"] = {**dock, "yaw_rad": wrap_angle(dock["yaw_rad"])}
    sets = site.documents(SETS).items()
    return {
        "format": "bewarenav site",
        "version": 1,
        "zones": _features(placed(zone, poses) for zone in site.zones()),
        "zone_sets": {
            name: _features(map(zone_of, zones_on(records, poses))) for name, records in sets
        },
        "missions": {
            name: {**mission, "goals": [_goal(goal, poses) for goal in mission["goals"]]}
            for name, mission in site.documents(MISSIONS).items()
        },
        "beware": None if beware is None else _beware_record(beware),
        **furnished,
        "accepted": None if accepted is None else cell_map_record(accepted),
        "unknown_price": stored_unknown_price(site),
    }


def furnishings_of(site: SiteStore) -> dict[str, Any]:
    """Return dock and tags of a site as JSON."""
    kind, name = FURNISHINGS
    return {"dock": None, "tags": [], **site.documents(kind).get(name, {})}


def unpack(archive: bytes) -> SiteContents:
    """Return the contents of an archive; raises `BadConfiguration` for one that is damaged, too
    large or not a site."""
    document, map_data = _parts(archive)
    try:
        read = _READ.validate_json(document)
    except ValidationError as error:
        where = ".".join(map(str, error.errors()[0]["loc"]))
        raise BadConfiguration(
            f"{DOCUMENT}: at {where:.120}: {first_sentence(error):.200}"
            if where
            else f"{DOCUMENT}: no JSON of a site"
        ) from None
    beware = None if read.beware is None else _beware_list(read.beware)
    if map_data is not None:
        _check_map(map_data, beware or default_beware_list())
    accepted = None if read.accepted is None else cell_map_of(read.accepted, "accepted map")
    return SiteContents(
        zones=_zones(read.zones),
        documents=tuple(_documents(read, accepted)),
        beware=beware,
        map_data=map_data,
    )


def _documents(read: SiteDocument, accepted: CellMap | None) -> Iterable[tuple[str, str, Any]]:
    for name, features in read.zone_sets.items():
        yield SETS, name, [zone_record(zone) for zone in _zones(features)]
    for name, mission in read.missions.items():
        yield MISSIONS, name, mission.model_dump()
    tags = [dataclasses.asdict(tag) for tag in read.tags]
    dock = None if read.dock is None else read.dock.model_dump()
    yield *FURNISHINGS, {"dock": dock, "tags": tags}
    if read.unknown_price is not None:
        yield *SETTINGS, {"unknown_price": read.unknown_price}
    if accepted is not None:
        yield *ACCEPTED, cell_map_record(accepted)


def _features(zones: Iterable[Zone]) -> list[dict[str, Any]]:
    return [ZoneOut.of(zone).model_dump(mode="json", exclude={"id"}) for zone in zones]


def _goal(record: dict[str, Any], poses: NumberedPoses) -> dict[str, Any]:
    """Return the record of a goal where a map has it, without what it belongs to there."""
    return goal_record(dataclasses.replace(placed(goal_of(record), poses), anchors=()))


def _zones(features: Iterable[ImportedFeatureIn]) -> tuple[Zone, ...]:
    return tuple(_zone(feature.draft()) for feature in features)


def _zone(draft: ZoneDraft) -> Zone:
    polygon = check_polygon(draft.polygon)
    zone = dataclasses.replace(
        Zone.of(draft, zone_id=uuid.uuid4().hex[:12], version=1),
        polygon=polygon,
        drawn=still_drawn(draft.drawn, polygon),
    )
    check_rules(zone)
    return zone


def _beware_record(beware: BewareList) -> dict[str, Any]:
    return {"classes": list(map(as_table, beware.classes)), "retired": beware.retired}


def _beware_list(read: BewareDocument) -> BewareList:
    named = BewareList(classes=tuple(read.classes), retired=tuple(read.retired))
    return named.replaced(named.classes)  # checks that no id has two names


def _parts(archive: bytes) -> tuple[bytes, bytes | None]:
    """Return the document and the map file of an archive, unpacked within bounds."""
    if len(archive) > MAX_ARCHIVE_BYTES:
        raise BadConfiguration(f"the archive is larger than {MAX_ARCHIVE_BYTES} bytes")
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as packed:
            names = sorted(entry.filename for entry in packed.infolist())
            if names not in ([DOCUMENT], [MAP_FILE, DOCUMENT]):
                raise BadConfiguration(
                    f"the archive is no site: expected {DOCUMENT} and {MAP_FILE} in it"
                )
            document = _read(packed, DOCUMENT, MAX_DOCUMENT_BYTES)
            map_data = _read(packed, MAP_FILE, MAX_ARCHIVE_BYTES) if MAP_FILE in names else None
    except _FAILURES:
        raise BadConfiguration("no zip archive, or a damaged one") from None
    return document, map_data


def _read(packed: zipfile.ZipFile, name: str, at_most: int) -> bytes:
    """Return an entry; what its header says of the size is not believed."""
    with packed.open(name) as entry:
        data = entry.read(at_most + 1)
    if len(data) > at_most:
        raise BadConfiguration(f"{name} is larger than {at_most} bytes")
    return data


def _check_map(data: bytes, beware: BewareList) -> None:
    """Raise `BadConfiguration` for a file that is no map, or not one of this beware list."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            size = sum(entry.file_size for entry in packed.infolist())
    except _FAILURES as error:
        raise BadConfiguration(f"{MAP_FILE}: no map file: {error!s:.200}") from None
    if size > MAX_MAP_PARTS_BYTES:
        raise BadConfiguration(f"{MAP_FILE}: {size} bytes unpacked, too many for an import")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / MAP_FILE
        path.write_bytes(data)
        map_file.check_classes(map_file.load(path), beware)
