"""The page of the workbench: a real browser asks with photos, a compass, and simulated views."""

from __future__ import annotations

import json
import re
import sys
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pytest
from map_pages import HOSTILE
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base
from selenium.webdriver.common.keys import Keys
from workbench import bomb
from workbench_pages import STAGE, WorkbenchPage

from benchmarks.street_photos import street_photo
from semsig_gis.evaluation import Sight
from semsig_gis.maps import to_latlon

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from selenium.webdriver import Chrome
    from workbench import Page

    from benchmarks.street_photos import StreetPhoto

PLACE, HEADING = 475, 180.0  # a cell from which five objects are seen ahead, and four behind


@pytest.fixture
def shown(
    browser: Chrome,
    page: Page,
    tmp_path: Path,
    carried: None,  # noqa: ARG001
) -> Iterator[WorkbenchPage]:
    """Return the open page, which must report no error and ask no other server."""
    shown = WorkbenchPage(browser, tmp_path, page.url)
    shown.open()
    yield shown
    shown.assert_quiet()


@pytest.fixture
def photos(page: Page, tmp_path: Path) -> list[StreetPhoto]:
    """Return two photos of one place, of which no file tells where the camera looks."""
    database = page.bench.database
    sight = Sight.of_cell(database, PLACE)
    return [
        street_photo(
            sight, database.taxonomy, heading=HEADING + turn, file=tmp_path / f"{name}.jpg"
        )
        for name, turn in (("ahead", 0.0), ("behind", 180.0))
    ]


def test_a_place_is_found_by_the_objects_of_two_photos(
    shown: WorkbenchPage, photos: list[StreetPhoto], page: Page
) -> None:
    database = page.bench.database
    assert shown.text("#sentence").startswith("Nothing was seen yet")
    ahead, behind = photos
    assert shown.give("#photo", ahead.file).startswith("Nothing is marked yet")
    said = shown.slide("#fov", ahead.fov)
    for number in range(5):
        said = shown.mark(ahead, number)
    assert shown.all(f"{STAGE} .mark")[4].get_attribute("aria-pressed") == "true"
    shown.give("#photo", behind.file)
    shown.slide("#fov", behind.fov)
    for number in range(4):
        said = shown.mark(behind, number)
    times = shown.ask(
        "return performance.getEntriesByName('semsig-answer').map((one) => one.duration)"
    )
    sys.stdout.write(f"a change is answered in {np.median(times):.0f} ms, of {len(times)}\n")
    found = re.match(r"Within 50 m of ([\d.]+), ([\d.]+) with a chance of .*%\.", said)
    assert found, said
    true = to_latlon(database.xy[[PLACE]], database.crs)[0]
    assert (
        shown.ask(
            "return L.latLng(...arguments[0]).distanceTo(L.latLng(...arguments[1]))",
            true.tolist(),
            [float(part) for part in found.groups()],
        )
        < 50
    )
    # Both wheels, rays and reasons of the likeliest, and another candidate by its button.
    assert [one.text for one in shown.all("#wheels figcaption")] == [
        "Marked, to 30 m",
        "At candidate 1, to 30 m",
    ]
    assert shown.all("#map path[stroke-width]")
    assert "Speaks for candidate 1" in shown.text("#speaks")
    # The verdicts of the wheels are those of the answer.
    wheels = "return [...document.querySelectorAll('#wheels figure')].map((figure) => "
    wheels += "[...figure.querySelectorAll('.object')].map((one) => one.classList[1]))"
    marked, there = shown.ask(wheels)
    rays = shown.ask("return semsig.session.answer.candidates[0].rays")
    own = [ray["verdict"] for ray in rays if ray["mark"] and ray["mark"][1] == 1]
    assert sorted(marked) == sorted(own)
    assert len(there) == sum(ray["distance"] is not None for ray in rays)
    shown.ask("document.querySelector('#wheels .object').focus()")
    assert len(shown.all("#wheels .lit")) == 2
    shown.press("#candidates button:nth-child(2)")
    assert "candidate 2" in shown.text("#wheels")
    assert shown.one("#candidates button:nth-child(2)").get_attribute("aria-pressed") == "true"
    # What is saved is what was asked and answered, photos by their names and hashes.
    shown.press("#save")
    kept = json.loads(shown.saved("session.semsig.json").read_text(encoding="utf-8"))
    assert [len(photo["marks"]) for photo in kept["views"][0]["photos"]] == [5, 4]
    assert re.fullmatch("[0-9a-f]{64}", kept["views"][0]["photos"][0]["sha256"])
    assert kept["answer"]["given"]
    shown.press("#new")
    assert not shown.one("#scene").is_displayed()
    assert shown.give("#open", shown.folder / "session.semsig.json") == said
    assert "drop ahead.jpg here" in shown.text(STAGE)
    shown.give("#photo", ahead.file)
    assert shown.all(f"{STAGE} img")
    assert len(shown.all(".tab")) == 2
    # The answer goes to other programs.
    for suffix in ("gpkg", "geojson", "kml"):
        shown.choose("#format", suffix)
        assert shown.saved(f"answer.{suffix}").stat().st_size
    assert len(gpd.read_file(shown.folder / "answer.gpkg", layer="candidates")) == 10
    shown.press("#command")
    assert "semsig localize" in str(shown.one("#line textarea").get_attribute("value"))
    shown.press("#line button")
    assert not shown.one("#line").is_displayed()


def test_marks_are_moved_named_and_removed_by_mouse_and_by_keys(
    shown: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    shown.give("#photo", photos[0].file)
    shown.drag(STAGE, (0.5, 0.5))
    marks = "return semsig.session.entries"
    (mark,) = shown.ask(marks)
    assert (mark["class"], mark["range"]) == ("?", None)
    assert mark["x"] == pytest.approx(480, abs=3)
    shown.press("#palette [data-name=bench]")  # names what has no name yet
    shown.drag(STAGE, (0.2, 0.2), (40, 60))  # a box of the same class
    mark, box = shown.ask(marks)
    assert (mark["class"], box["class"]) == ("bench", "bench")
    assert (np.array(box["box"][2:]) > np.array(box["box"][:2])).all()
    shown.choose("#class", "bus_stop")
    shown.choose("#range", "far")
    assert shown.text(f"{STAGE} .mark[aria-pressed=true]").endswith("far")
    # Up and down is the distance, sideways the direction.
    chosen = f"{STAGE} .mark[aria-pressed=true]"
    shown.drag(chosen, (0.5, 0.5), (0, 20), (0, 20))
    assert shown.ask(marks)[1]["range"] < 25
    before = shown.ask(marks)[1]["box"]
    shown.drag(chosen, (0.5, 0.5), (20, 0), (20, 0))
    assert shown.ask(marks)[1]["box"][0] > before[0]
    shown.type(Keys.ARROW_LEFT, Keys.ARROW_UP)
    shown.choose("#range", "")
    shown.drag(f"{STAGE} .mark:not([aria-pressed=true])", (0.5, 0.5))
    shown.drag(f"{STAGE} .mark[aria-pressed=true]", (0.5, 0.5), (30, 0))
    assert shown.ask(marks)[0]["x"] > mark["x"]
    shown.one(f"{STAGE} .mark:not([aria-pressed=true])").send_keys(Keys.ENTER)
    assert shown.ask("return semsig.session.mark === semsig.session.entries[1]")
    shown.type("d")
    assert shown.ask(marks)[1]["class"] == "street_light"
    shown.type(Keys.DELETE)
    assert len(shown.ask(marks)) == 1
    shown.press("#marks button:nth-child(1)")
    shown.type(Keys.ESCAPE, "F5")
    assert not shown.all("#class")
    shown.press("#marks button:nth-child(1)")
    shown.press("#remove-mark")
    assert shown.settle().startswith("Nothing is marked yet")
    shown.press("#add-mark")
    # The camera, and where it looks.
    shown.choose("#heading-known", "known")
    shown.slide("#heading", 200)
    shown.choose("#kind", "equirectangular")
    photo = shown.ask("return semsig.session.scene")
    assert (photo["fov"], photo["heading"], photo["heading_error"]) == (360, 200, 10)
    shown.choose("#heading-known", "")
    assert shown.ask("return semsig.session.scene.heading") is None


def test_what_a_photo_says_of_itself_is_taken(
    shown: WorkbenchPage, photos: list[StreetPhoto], page: Page, tmp_path: Path
) -> None:
    database = page.bench.database
    place = to_latlon(database.xy[[PLACE]], database.crs)[0]
    exif = Image.Exif()
    exif.get_ifd(IFD.Exif)[Base.FocalLengthIn35mmFilm] = 28
    exif.get_ifd(IFD.GPSInfo).update(
        {
            GPS.GPSLatitudeRef: "N",
            GPS.GPSLatitude: (float(place[0]), 0.0, 0.0),
            GPS.GPSLongitudeRef: "E",
            GPS.GPSLongitude: (float(place[1]), 0.0, 0.0),
            GPS.GPSImgDirection: 180.0,
            GPS.GPSImgDirectionRef: "T",
        }
    )
    file = tmp_path / "phone.jpg"
    Image.open(photos[0].file).save(file, exif=exif)
    shown.give("#photo", file)
    photo = shown.ask("return semsig.session.scene")
    assert photo["fov"] == pytest.approx(63.4, abs=1)
    assert photo["heading"] == pytest.approx(180, abs=2)
    assert "as the photo says" in shown.text("#camera legend")
    there = "const {lat, lng} = semsig.map.getCenter(); return [lat, lng]"
    assert shown.ask(there) == pytest.approx(place.tolist(), abs=1e-4)
    shown.mark(photos[0], 0)
    # Its place can be believed.
    assert "--near" not in shown.ask("return semsig.session.answer.command")
    left = shown.ask("return semsig.session.answer.places_left")
    shown.press("#near")
    shown.settle()
    assert shown.ask("return semsig.session.body().near") == [*photo["place"], 50]
    assert shown.ask("return semsig.session.answer.places_left") < left
    shown.one("#near-metres").send_keys(Keys.CONTROL, "a")
    shown.type("20", Keys.ENTER)
    command = shown.ask("return semsig.session.answer.command")
    told = command.split("--near ")[1].split()[0]
    assert told == f"{photo['place'][0]:.10g}N,{photo['place'][1]:.10g}E,20"
    assert shown.ask("return semsig.session.saved().near") == [*photo["place"], 20]
    # Another one some steps on is another place of the same question.
    shown.give("#photo-on", photos[1].file)
    shown.mark(photos[1], 0)
    assert [len(view["photos"]) for view in shown.ask("return semsig.session.body().views")] == [
        1,
        1,
    ]
    assert [one.text for one in shown.all(".view small")] == ["Place 1", "Place 2"]
    # What is chosen in a photo is shown on the map, and back.
    assert len(shown.all("#map .at.chosen")) == 1
    shown.press("#map .at.chosen")
    assert shown.all(f"{STAGE} .mark[aria-pressed=true]")


def test_what_would_tell_most_is_asked_next(
    shown: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    shown.give("#photo", photos[0].file)
    shown.mark(photos[0], 0)
    first = shown.question()
    assert re.fullmatch(r"Is there an?(other)? .* within 30 m\?", first)
    shown.press("#question button", "Ask another")
    second = shown.question()
    assert second != first
    before = shown.ask("return semsig.session.answer.places_left")
    shown.press("#question button", "No")
    assert shown.question() != second
    (told,) = shown.all("#question .absent button")
    assert told.text.startswith("No ")
    assert shown.ask("return semsig.session.answer.places_left") < before
    told.click()
    shown.settle()
    assert shown.ask("return semsig.session.absent") == []
    # A question that cannot be had is not asked; the answer stands.
    shown.ask(
        "const own = window.fetch; window.fetch = (path, ...more) => { window.asked = path;"
        "return path.includes('suggest') ? Promise.reject(new TypeError('gone'))"
        " : own(path, ...more); }; window.restored = () => { window.fetch = own; };"
    )
    assert shown.mark(photos[0], 1).startswith(("Cannot tell", "Within"))
    shown.until("return window.asked.includes('suggest')")
    assert shown.text("#question") == ""
    shown.ask("restored()")
    shown.mark(photos[0], 2)
    shown.question()
    shown.press("#question button", "Yes, I mark it")
    assert shown.ask("return semsig.session.brush") in shown.ask(
        "return semsig.session.city.classes.map((one) => one.name)"
    )


def test_a_view_is_composed_on_a_compass(shown: WorkbenchPage) -> None:
    shown.press("#add-compass")
    shown.press("#palette [data-name=bench]")
    shown.drag(STAGE, (0.5, 0.3))
    shown.drag(STAGE, (0.99, 0.5))
    entries = "return semsig.session.entries"
    north, east = shown.ask(entries)
    assert (north["bearing"] % 360, east["bearing"]) == (pytest.approx(0, abs=2), 90)
    assert 5 < north["range"] < 20
    assert east["range"] is None
    shown.drag(f"{STAGE} .mark[aria-pressed=true]", (0.5, 0.5), (-60, 60), (-20, 20))
    assert 100 < shown.ask(entries)[1]["bearing"] < 180
    turned = shown.ask(entries)[1]
    shown.type(Keys.ARROW_RIGHT, Keys.ARROW_DOWN)
    assert shown.ask(entries)[1]["bearing"] == turned["bearing"] + 5
    assert shown.ask(entries)[1]["range"] < turned["range"]
    shown.choose("#turn-seen", "part")
    shown.one("#sector-0").clear()
    shown.one("#sector-0").send_keys("300", Keys.TAB)
    shown.settle()
    assert shown.ask("return semsig.session.scene.sectors") == [[300, 45]]
    shown.choose("#north", "unknown")
    assert shown.ask("return semsig.session.answer.views[0].heading_error") == "unknown"
    # A second one some steps on; the answer is where the view is that is shown.
    shown.press("#add-compass")
    shown.press("#add-mark")
    shown.one("#step-metres").clear()
    shown.one("#step-metres").send_keys("15", Keys.TAB)
    shown.settle()
    assert shown.ask("return semsig.session.body().views[1].step") == {"bearing": 0, "metres": 15}
    place = shown.text("#wheels")
    shown.press(".tab")
    assert shown.text("#wheels") != place or shown.ask("return semsig.session.body().view") == 0
    shown.one("[aria-label='Remove Compass']").click()
    shown.settle()
    assert shown.ask("return semsig.session.views[0].step") is None


def test_a_view_is_simulated_spoiled_and_found_or_not(shown: WorkbenchPage, page: Page) -> None:
    database = page.bench.database
    place = to_latlon(database.xy[[PLACE]], database.crs)[0].tolist()
    click = "semsig.map.fire('click', {latlng: L.latLng(...arguments)})"
    shown.ask(click, *place)  # tells nothing before it is switched on
    shown.press("#simulate")
    shown.press("#again")
    assert shown.text("#notice").startswith("Click a place on the map first")
    shown.ask(click, *place)
    shown.until("return semsig.session.truth")
    assert re.match("Found: the best place is .* rank 1. Within 50 m", shown.settle())
    assert shown.text("#notice") == ""
    whole = len(shown.ask("return semsig.session.entries"))
    shown.choose("#turn", "70")
    shown.until("return semsig.session.scene.sectors")
    assert len(shown.ask("return semsig.session.entries")) < whole
    # Spoiled, and spoiled otherwise.
    shown.choose("#spoil", "strong")
    views = set()
    for _ in range(3):
        before = shown.ask("return semsig.session.views[0]")
        shown.press("#again")
        shown.until(
            "return JSON.stringify(semsig.session.views[0]) !== arguments[0]",
            json.dumps(before, separators=(",", ":"), ensure_ascii=False),
        )
        assert re.match("(Found|Wrong|Not found): ", shown.settle())
        views.add(json.dumps(shown.ask("return semsig.session.entries")))
    assert len(views) > 1
    # What was made by hand is not lost without a question.
    shown.press("#new")
    shown.press("#add-compass")
    shown.ask(click, *place)
    shown.browser.switch_to.alert.dismiss()
    assert shown.ask("return semsig.session.truth") is None
    shown.press("#simulate")
    assert not shown.one("#spoiling").is_displayed()
    # What it is compared with may be another city.
    shown.press("#add-mark")
    shown.ask("document.getElementById('assumptions').open = true")
    shown.choose("#noise", "light")
    shown.choose("#from", "cells")
    body = shown.ask("return semsig.session.body()")
    assert (body["noise"], body["seen_from"]) == ("light", "cells")


def test_what_is_no_photo_is_refused_in_one_sentence(shown: WorkbenchPage, tmp_path: Path) -> None:
    files = {
        "notes.jpg": b"only words",
        "drawing.svg": b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>',
        "phone.heic": b"\0\0\0\x18ftypheic\0\0\0\0heicmif1" + bytes(100),
        "large.jpg": bytes(26 * 2**20),
        "bomb.png": bomb(),
    }
    for name, content in files.items():
        file = tmp_path / name
        file.write_bytes(content)
        shown.give("#photo", file)
        said = shown.until("return document.querySelector('#notice span')?.textContent")
        assert re.fullmatch(rf".*{name}.*\.", said), said
        assert shown.all(".tab") == []
        shown.press("#notice button")
    assert not shown.one("#notice").is_displayed()


def test_boxes_of_a_detector_become_marks(
    shown: WorkbenchPage, photos: list[StreetPhoto], tmp_path: Path
) -> None:
    left, top, right, bottom = photos[0].things[0][1]
    coco = {
        "images": [{"id": 1, "file_name": "ahead.jpg", "width": 960, "height": 720}],
        "categories": [{"id": 1, "name": "bench"}, {"id": 2, "name": "dog"}],
        "annotations": [
            {
                "id": 1,
                "image_id": 1,
                "category_id": 1,
                "score": 0.9,
                "bbox": [left, top, right - left, bottom - top],
            },
            {"id": 2, "image_id": 1, "category_id": 2, "score": 0.9, "bbox": [1, 1, 40, 40]},
        ],
    }
    file = tmp_path / "boxes.json"
    file.write_text(json.dumps(coco), encoding="utf-8")
    shown.give("#photo", photos[0].file)
    shown.give("#boxes", file)
    (mark,) = shown.until("return semsig.session.entries.length && semsig.session.entries")
    assert mark["class"] == "bench"
    assert shown.settle().startswith(("Cannot tell", "Within"))
    # Of YOLO, with the list of its labels.
    yolo, labels = tmp_path / "ahead.txt", tmp_path / "classes.txt"
    yolo.write_text("1 0.5 0.5 0.1 0.1 0.8\n", encoding="utf-8")
    labels.write_text("dog\nbench\n", encoding="utf-8")
    shown.give("#boxes", yolo, labels)
    assert [one["class"] for one in shown.ask("return semsig.session.entries")] == 2 * ["bench"]
    file.write_text("[", encoding="utf-8")
    shown.give("#boxes", file)
    assert "boxes.json" in shown.until("return document.querySelector('#notice span')?.textContent")


def test_a_file_that_is_no_session_of_this_city_is_refused(
    shown: WorkbenchPage, tmp_path: Path
) -> None:
    session = shown.ask("return semsig.session.saved()")
    changes: list[tuple[dict[str, Any] | None, str]] = [
        (None, "not a session"),
        ({"version": 2}, "not a session"),
        ({"views": [{"photos": [{}]}]}, "not a session"),
        ({"city": {"name": "elsewhere", "fingerprint": "0"}}, "elsewhere"),
    ]
    for number, (change, word) in enumerate(changes):
        file = tmp_path / f"session{number}.json"
        text = "{" if change is None else json.dumps({**session, **change})
        file.write_text(text, encoding="utf-8")
        shown.give("#open", file)
        said = shown.until("return document.querySelector('#notice span')?.textContent")
        assert word in said
        shown.press("#notice button")


def test_text_from_files_stays_text(shown: WorkbenchPage, tmp_path: Path) -> None:
    file = tmp_path / "a.jpg"
    Image.new("RGB", (40, 20)).save(file)
    shown.give("#photo", file)
    shown.until("return semsig.session.scene")
    session = shown.ask("return semsig.session.saved()")
    photo = {**session["views"][0]["photos"][0], "name": HOSTILE, "sha256": "0"}
    session["views"] = [{"photos": [photo], "step": None}]
    saved = tmp_path / "session.json"
    saved.write_text(json.dumps(session), encoding="utf-8")
    shown.give("#open", saved)
    shown.until("return semsig.session.scene?.name !== 'a.jpg'")
    assert HOSTILE in shown.text(".tab")
    assert shown.all("#seen script, #seen img") == []


def test_files_are_dropped_on_the_page(shown: WorkbenchPage, photos: list[StreetPhoto]) -> None:
    content = photos[0].file.read_bytes()
    shown.ask(
        "const files = new DataTransfer();"
        "files.items.add(new File([new Uint8Array(arguments[0])], 'ahead.jpg'));"
        "files.items.add(new File(['['], 'boxes.json'));"
        "for (const kind of ['dragover', 'drop']) document.body.dispatchEvent(new DragEvent("
        "kind, {dataTransfer: files, bubbles: true, cancelable: true}));",
        list(content),
    )
    assert "boxes.json" in shown.until("return document.querySelector('#notice span')?.textContent")
    assert [one.text for one in shown.all(".tab")] == ["ahead.jpg"]
    # As light or dark as it is wished.
    shown.press(".semsig-colours")
    assert shown.all("body.dark")


def test_streets_are_drawn_and_found_as_are_cells(shown: WorkbenchPage, page: Page) -> None:
    assert shown.all("#map canvas.semsig-ground")
    search = ".semsig-search input"
    shown.one(search).send_keys("ecole", Keys.ENTER)
    assert shown.text(".leaflet-tooltip") == "Rue de l'École"
    shown.one(search).clear()
    shown.one(search).send_keys(str(page.bench.database.cell_ids[PLACE]), Keys.ENTER)
    database = page.bench.database
    place = to_latlon(database.xy[[PLACE]], database.crs)[0]
    there = "const {lat, lng} = semsig.map.getCenter(); return [lat, lng]"
    assert shown.ask(there) == pytest.approx(place.tolist(), abs=1e-4)
    shown.ask("semsig.map.fire('click', {latlng: semsig.map.getCenter()})")
    shown.until("return !document.querySelector('.leaflet-tooltip')")


def test_a_server_that_has_ended_is_told(shown: WorkbenchPage) -> None:
    shown.ask("window.fetch = () => new Promise((_, fail) => { window.fail = fail; })")
    shown.press("#add-compass")
    shown.one("#add-mark").click()
    assert shown.one("#answer").get_attribute("aria-busy") == "true"
    shown.ask("fail(new TypeError('gone'))")
    assert "is semsig serve still running?" in shown.settle()
    assert shown.one("#answer").get_attribute("aria-busy") is None
