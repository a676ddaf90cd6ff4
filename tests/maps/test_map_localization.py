"""The map of a ranking by distance in a real browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from map_pages import LEGEND

from semsig_gis.core.signs import CANDIDATE_RAMP
from semsig_gis.maps.location import localization_map
from semsig_gis.matching.search import localize

if TYPE_CHECKING:
    from map_pages import MapPage

    from semsig_gis.database.database import SignatureDatabase


def test_a_localization_in_a_browser(page: MapPage, database: SignatureDatabase) -> None:
    cell = int(np.argmax(database.lengths))
    localization = localize(database, database.signature(cell), top=50)
    page.open(localization_map(localization, database))
    texts = """
    const texts = [];
    map.eachLayer((one) => {
      if (one instanceof L.CircleMarker) texts.push(one.getPopup().getContent()(one).textContent);
    });
    return texts;
    """
    popups = page.ask(texts)
    assert len(popups) == 50
    best = popups[-1]  # drawn last, on top
    assert best.startswith("Rank 1")
    assert "Rank1 of " in best
    assert str(database.cell_ids[cell]) in best
    assert database.types(cell) in best
    # The query and what the cell sees, side by side.
    page.ask("circles(arguments[0])[0].openPopup()", CANDIDATE_RAMP[0])
    captions = [one.get_property("innerText") for one in page.all("figcaption")]
    assert captions == ["Query", "Signature"]
    page.ask("map.closePopup()")
    assert f"Types: {database.types(cell)}" in page.one(LEGEND).text
    page.switch("Candidates")
    assert page.ask(texts) == []
