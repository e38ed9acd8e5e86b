"""The settings of the path: kept with the site, undone and repeated, and held back at a change of
the site."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from app.console.mission.path_settings import PathSettings, stored_unknown_price
from app.console.site.site_archive import pack
from app.console.site.site_files import add
from app.storage import Store
from navcore.errors import Refused
from tests.app.console.state import PlainHolder


def test_a_price_is_kept_with_the_site_and_is_in_the_next_request(tmp_path: Path) -> None:
    holder = PlainHolder()
    with closing(Store(tmp_path)) as store:
        settings = PathSettings(holder, store=store.site, configured=2.0)
        assert (settings.unknown_price, holder.intent.request.unknown_price) == (2.0, None)
        settings.set_unknown_price(5.0)
        assert holder.intent.request.unknown_price == 5.0
        add(store.sites, "copy", pack(store.site))
        assert stored_unknown_price(store.sites.open("copy")) == 5.0
    with closing(Store(tmp_path)) as store:
        assert stored_unknown_price(store.site) == 5.0


def test_undo_goes_back_to_the_configuration_and_redo_repeats(tmp_path: Path) -> None:
    holder = PlainHolder()
    with closing(Store(tmp_path)) as store:
        settings = PathSettings(holder, store=store.site, configured=2.0)
        settings.set_unknown_price(2.0)  # in force already
        with pytest.raises(Refused, match="no edit"):
            settings.undo()
        settings.set_unknown_price(5.0)
        settings.set_unknown_price(3.0)
        assert [settings.undo(), settings.undo()] == [
            "cost of unseen floor: × 3",
            "cost of unseen floor: × 5",
        ]
        assert (settings.unknown_price, stored_unknown_price(store.site)) == (2.0, None)
        settings.redo()
        assert (settings.unknown_price, stored_unknown_price(store.site)) == (5.0, 5.0)
        assert settings.history.redo == "cost of unseen floor: × 3"
        settings.set_unknown_price(4.0)
        with pytest.raises(Refused, match="no edit"):
            settings.redo()


def test_settings_of_a_site_that_was_left_change_nothing(tmp_path: Path) -> None:
    holder = PlainHolder()
    with closing(Store(tmp_path)) as store:
        settings = PathSettings(holder, store=store.site, configured=1.0)
        with settings.retired():
            pass
        with pytest.raises(Refused, match="another site now"):
            settings.set_unknown_price(5.0)
        assert (settings.unknown_price, stored_unknown_price(store.site)) == (1.0, None)
