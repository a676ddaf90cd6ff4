"""The page of the workbench in a browser: photos, a compass, and simulated views."""

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
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.keys import Keys
from workbench import coco, decompression_bomb
from workbench_pages import STAGE, WorkbenchPage

from benchmarks.street_photos import street_photo
from semsig_gis.core import place_links
from semsig_gis.evaluation import Sight
from semsig_gis.output import to_latlon

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from selenium.webdriver import Chrome
    from workbench import Page

    from benchmarks.street_photos import StreetPhoto

# The verdicts of the objects of each wheel.
WHEELS = """
return [...document.querySelectorAll('#wheels figure')].map((figure) =>
  [...figure.querySelectorAll('.object')].map(({classList}) => classList[1]));
"""
DISTANCE = "return L.latLng(...arguments[0]).distanceTo(L.latLng(...arguments[1]))"
PLACE, HEADING = 475, 180.0  # a cell with five visible objects ahead, and four behind


@pytest.fixture
def workbench(
    browser: Chrome,
    page: Page,
    tmp_path: Path,
    map_files: None,  # noqa: ARG001
) -> Iterator[WorkbenchPage]:
    """Return the open page, which must report no error and request no other server."""
    workbench = WorkbenchPage(browser, tmp_path, page.url)
    workbench.open()
    yield workbench
    workbench.assert_quiet()


@pytest.fixture
def photos(page: Page, tmp_path: Path) -> list[StreetPhoto]:
    """Return two photos from one place without a heading in their files."""
    database = page.bench.database
    sight = Sight.of_cell(database, PLACE)
    return [
        street_photo(
            sight, database.taxonomy, heading=HEADING + turn, file=tmp_path / f"{name}.jpg"
        )
        for name, turn in (("ahead", 0.0), ("behind", 180.0))
    ]


def test_two_photos_are_localized_saved_and_exported(
    workbench: WorkbenchPage, photos: list[StreetPhoto], page: Page
) -> None:
    assert workbench.text("#sentence").startswith("Nothing was seen yet")
    ahead, behind = photos
    assert workbench.give("#photo", ahead.file).startswith("Nothing is marked yet")
    workbench.choose("#fov-known", "known")
    workbench.slide("#fov", ahead.fov)
    sentences = [workbench.mark(ahead, number) for number in range(5)]
    assert workbench.all(f"{STAGE} .mark")[4].get_attribute("aria-pressed") == "true"
    workbench.give("#photo", behind.file)
    workbench.choose("#fov-known", "known")
    workbench.slide("#fov", behind.fov)
    sentences += [workbench.mark(behind, number) for number in range(4)]
    sentence = sentences[-1]
    times = "return performance.getEntriesByName('semsig-answer').map(({duration}) => duration)"
    sys.stdout.write(f"a change is answered in {np.median(workbench.ask(times)):.0f} ms\n")
    answer_match = re.match(r"Within 50 m of ([\d.]+), ([\d.]+) .*with a chance of .*%\.", sentence)
    assert answer_match, sentence
    true = to_latlon(page.bench.database.xy[[PLACE]], page.bench.database.crs)[0]
    assert workbench.ask(DISTANCE, true.tolist(), list(map(float, answer_match.groups()))) < 50
    # The page shows wheels, rays and reasons of the likeliest candidate, and others by buttons.
    captions = [element.text for element in workbench.all("#wheels figcaption")]
    assert captions == ["Marked, to 30 m", "At candidate 1, to 30 m"]
    assert workbench.all("#map path[stroke-width]")
    assert "Speaks for candidate 1" in workbench.text("#speaks")
    # The wheels show the verdicts of the answer.
    marked, there = workbench.ask(WHEELS)
    rays = workbench.ask("return semsig.session.answer.candidates[0].rays")
    own = [ray["verdict"] for ray in rays if ray["mark"] and ray["mark"][1] == 1]
    assert sorted(marked) == sorted(own)
    assert len(there) == sum(ray["distance"] is not None for ray in rays)
    workbench.ask("document.querySelector('#wheels .object').focus()")
    assert len(workbench.all("#wheels .lit")) == 2
    workbench.press("#candidates button:nth-child(2)")
    assert "candidate 2" in workbench.text("#wheels")
    assert workbench.one("#candidates button:nth-child(2)").get_attribute("aria-pressed") == "true"
    # A saved session contains views and answer, and names and checksums of photos.
    workbench.press("#save")
    saved_session = json.loads(workbench.saved("session.semsig.json").read_text(encoding="utf-8"))
    assert [len(photo["marks"]) for photo in saved_session["views"][0]["photos"]] == [5, 4]
    assert re.fullmatch("[0-9a-f]{64}", saved_session["views"][0]["photos"][0]["sha256"])
    assert saved_session["answer"]["given"]
    workbench.press("#new")
    assert not workbench.one("#scene").is_displayed()
    assert workbench.give("#open", workbench.folder / "session.semsig.json") == sentence
    assert "drop ahead.jpg here" in workbench.text(STAGE)
    workbench.give("#photo", ahead.file)
    assert (len(workbench.all(f"{STAGE} img")), len(workbench.all(".tab"))) == (1, 2)
    # The answer is exported for other programs.
    for suffix in ("gpkg", "geojson", "kml"):
        workbench.choose("#format", suffix)
        assert workbench.saved(f"answer.{suffix}").stat().st_size
    assert len(gpd.read_file(workbench.folder / "answer.gpkg", layer="candidates")) == 10
    workbench.press("#command")
    assert "semsig localize" in str(workbench.one("#line textarea").get_attribute("value"))
    workbench.press("#line button")
    assert not workbench.one("#line").is_displayed()


def test_marks_are_edited_by_mouse_and_keyboard(
    workbench: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    workbench.give("#photo", photos[0].file)
    workbench.drag(STAGE, (0.5, 0.5))
    marks = "return semsig.session.entries"
    (mark,) = workbench.ask(marks)
    assert (mark["class"], mark["range"]) == ("?", None)
    assert mark["x"] == pytest.approx(480, abs=3)
    workbench.type("bench", Keys.ENTER)
    workbench.brush("bench")
    workbench.drag(STAGE, (0.2, 0.2), (40, 60))  # a box of the same class
    assert not workbench.one("#classes").is_displayed()
    mark, box = workbench.ask(marks)
    assert (mark["class"], box["class"]) == ("bench", "bench")
    assert (np.array(box["box"][2:]) > np.array(box["box"][:2])).all()
    workbench.choose("#class", "bus_stop")
    workbench.choose("#range", "far")
    assert workbench.text(f"{STAGE} .mark[aria-pressed=true]").endswith("far")
    # Up and down changes the distance, sideways the direction.
    selected_mark = f"{STAGE} .mark[aria-pressed=true]"
    workbench.drag(selected_mark, (0.5, 0.5), (0, 20), (0, 20))
    assert workbench.ask(marks)[1]["range"] < 25
    before = workbench.ask(marks)[1]["box"]
    workbench.drag(selected_mark, (0.5, 0.5), (20, 0), (20, 0))
    assert workbench.ask(marks)[1]["box"][0] > before[0]
    workbench.type(Keys.ARROW_LEFT, Keys.ARROW_UP)
    workbench.choose("#range", "")
    workbench.drag(f"{STAGE} .mark:not([aria-pressed=true])", (0.5, 0.5))
    workbench.drag(f"{STAGE} .mark[aria-pressed=true]", (0.5, 0.5), (30, 0))
    assert workbench.ask(marks)[0]["x"] > mark["x"]
    workbench.one(f"{STAGE} .mark:not([aria-pressed=true])").send_keys(Keys.ENTER)
    assert workbench.ask("return semsig.session.mark === semsig.session.entries[1]")
    workbench.type("street light", Keys.ENTER)
    assert workbench.ask(marks)[1]["class"] == "street_light"
    workbench.type(Keys.DELETE)
    assert len(workbench.ask(marks)) == 1
    workbench.press("#marks button:nth-child(1)")
    workbench.type(Keys.ESCAPE, "F5")
    assert not workbench.all("#class")
    workbench.press("#marks button:nth-child(1)")
    workbench.press("#remove-mark")
    assert workbench.settle().startswith("Nothing is marked yet")
    workbench.press("#add-mark")
    # The settings of the camera.
    workbench.choose("#heading-known", "known")
    workbench.slide("#heading", 200)
    workbench.choose("#kind", "equirectangular")
    photo = workbench.ask("return semsig.session.scene")
    assert (photo["fov"], photo["heading"], photo["heading_error"]) == (360, 200, 10)
    for kind, fov in (("fisheye", 180), ("cylindrical", 360), ("pinhole", None)):
        workbench.choose("#kind", kind)
        assert workbench.ask("return semsig.session.scene.fov") == fov
    assert workbench.one("#fov-known").get_attribute("value") == ""
    workbench.choose("#heading-known", "")
    assert workbench.ask("return semsig.session.scene.heading") is None


def test_menu_at_the_click_lists_frequent_classes_first_and_searches(
    workbench: WorkbenchPage, photos: list[StreetPhoto], page: Page
) -> None:
    marks = "return semsig.session.entries.map((entry) => entry.class)"
    listed = (
        "return [...document.querySelectorAll('#class-list .offer span')].map("
        "({textContent}) => textContent)"
    )
    workbench.give("#photo", photos[0].file)
    workbench.drag(STAGE, (0.5, 0.5))
    database = page.bench.database
    codes = sorted(database.present_codes.tolist(), key=lambda code: -database.occurrences[code])
    titles = [database.taxonomy.by_code(code).title for code in codes]
    assert workbench.ask(listed) == [*titles, "Something unnamed"]
    workbench.type("BEN")
    assert workbench.ask(listed) == ["Bench"]
    workbench.type(Keys.ENTER)
    assert workbench.ask(marks) == ["bench"]
    # A letter opens it at the selected mark; an unknown word changes nothing.
    workbench.type("b", "us", Keys.ENTER)
    assert workbench.ask(marks) == ["bus_stop"]
    workbench.type("zebra", Keys.ENTER)
    assert workbench.ask(listed) == ["The city has no such class."]
    workbench.type(Keys.ESCAPE)
    workbench.press(f"{STAGE} .mark")
    workbench.type(Keys.ARROW_DOWN, Keys.ENTER)
    assert workbench.ask(marks) == [database.taxonomy.by_code(codes[1]).name]
    # A click elsewhere closes it.
    workbench.press(f"{STAGE} .mark")
    workbench.press("h1")
    assert not workbench.one("#classes").is_displayed()


def test_photo_is_as_wide_as_its_column_and_zooms(
    workbench: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    workbench.give("#photo", photos[0].file)
    column = workbench.ask("return document.querySelector('#picture').clientWidth")
    sheet = "return document.querySelector('#picture .sheet').getBoundingClientRect().toJSON()"
    whole = workbench.ask(sheet)
    assert whole["width"] == pytest.approx(column, abs=1)
    # The wheel zooms at the pointer: what is there stays there.
    stage = workbench.one(STAGE)
    wheel = ScrollOrigin.from_element(stage, 100, 50)
    ActionChains(workbench.browser).scroll_from_origin(wheel, 0, -400).perform()
    zoomed = workbench.ask(sheet)
    assert zoomed["width"] > 2 * whole["width"]
    share = (whole["width"] / 2 + 100) / whole["width"]
    at = zoomed["left"] + share * zoomed["width"] - whole["left"]
    assert at == pytest.approx(share * whole["width"], abs=3)
    # A click in a zoomed photo marks the place under the pointer.
    workbench.drag(STAGE, (0.5, 0.5))
    x = workbench.ask("return semsig.session.entries[0].x")
    shown = (whole["left"] + whole["width"] / 2 - zoomed["left"]) / zoomed["width"]
    assert x == pytest.approx(shown * 960, abs=3)
    workbench.type(Keys.ESCAPE, Keys.ESCAPE)
    # Buttons, keys, and the photo itself move and zoom; it never leaves its frame.
    workbench.press(".zoom-in")
    assert workbench.ask(sheet)["width"] > zoomed["width"]
    workbench.press(".move")
    before = workbench.ask(sheet)["left"]
    workbench.drag(STAGE, (0.3, 0.3), (40, 20))
    assert workbench.ask(sheet)["left"] == pytest.approx(before + 40, abs=2)
    assert len(workbench.ask("return semsig.session.entries")) == 1
    workbench.drag(STAGE, (0.2, 0.7))  # a click still marks
    assert len(workbench.ask("return semsig.session.entries")) == 2
    workbench.type(Keys.ESCAPE, Keys.ESCAPE)
    workbench.press(".move")
    workbench.ask("arguments[0].focus()", workbench.one(STAGE))
    before = workbench.ask(sheet)["left"]
    workbench.type(Keys.ARROW_LEFT)
    assert workbench.ask(sheet)["left"] > before
    workbench.type(*("-" * 20))
    assert workbench.ask(sheet) == pytest.approx(whole, abs=1)


def test_marks_and_answers_are_undone_and_not_lost(
    workbench: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    classes = "return semsig.session.entries.map((entry) => entry.class)"
    workbench.give("#photo", photos[0].file)
    workbench.mark(photos[0], 0)
    sentence = workbench.settle()
    workbench.drag(STAGE, (0.1, 0.1))
    workbench.type("bench", Keys.ENTER)
    first, second = workbench.ask(classes)
    assert second == "bench"
    # A mark and its class are one step, and so is a whole drag.
    workbench.press("#undo")
    assert workbench.ask(classes) == [first]
    assert workbench.settle() == sentence
    workbench.chord(Keys.CONTROL, "y")
    assert workbench.ask(classes) == [first, "bench"]
    selected = f"{STAGE} .mark:last-of-type"
    x = workbench.ask("return semsig.session.entries[1].x")
    workbench.drag(selected, (0.5, 0.5), (15, 0), (15, 0), (15, 0))
    assert workbench.ask("return semsig.session.entries[1].x") > x
    workbench.chord(Keys.CONTROL, "z")
    assert workbench.ask("return semsig.session.entries[1].x") == x
    workbench.chord(Keys.CONTROL, Keys.SHIFT, "z")
    assert workbench.ask("return semsig.session.entries[1].x") > x
    workbench.press("#undo")
    # An answer to a question is undone as well, and a new change ends what can be redone.
    workbench.question()
    workbench.press("#question button", "No")
    assert len(workbench.ask("return semsig.session.absent")) == 1
    assert workbench.one("#redo").get_attribute("disabled")
    workbench.press("#undo")
    assert workbench.ask("return semsig.session.absent") == []
    # Marks are not lost without a question.
    workbench.one("#new").click()
    workbench.browser.switch_to.alert.dismiss()
    assert workbench.ask(classes) == [first, "bench"]
    leaves = (
        "const leaving = new Event('beforeunload', {cancelable: true});"
        "window.dispatchEvent(leaving); return leaving.defaultPrevented;"
    )
    assert workbench.ask(leaves)
    workbench.press("#save")
    workbench.saved("session.semsig.json")
    assert not workbench.ask(leaves)
    workbench.press("#new")
    assert workbench.ask(classes) == []
    workbench.press("#undo")
    assert workbench.ask(classes) == [first, "bench"]
    assert workbench.all(f"{STAGE} img")


def test_settings_of_two_photos_are_two_steps(
    workbench: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    for photo in photos:
        workbench.give("#photo", photo.file)
        workbench.choose("#heading-known", "known")
    headings = "return semsig.session.scenes.map(({heading}) => heading)"
    for name, heading in (("ahead.jpg", 100), ("behind.jpg", 200)):
        workbench.press(".tab", name)
        workbench.slide("#heading", heading - 10)
        workbench.slide("#heading", heading)
    assert workbench.ask(headings) == [100, 200]
    workbench.press("#undo")
    assert workbench.ask(headings) == [100, 0]
    workbench.press("#undo")
    assert workbench.ask(headings) == [0, 0]


def test_unknown_field_of_view_and_refined_numbers_are_shown(
    workbench: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    workbench.ask(
        "window.refining = []; new MutationObserver(() => window.refining.push("
        "!document.getElementById('refining').hidden)).observe("
        "document.getElementById('refining'), {attributes: true});"
    )
    workbench.give("#photo", photos[0].file)
    assert workbench.ask("return semsig.session.scene.fov") is None
    assert not workbench.all("#fov")
    for number in range(4):
        workbench.mark(photos[0], number)
    assert re.fullmatch(r"Likeliest here: (40|55|70|85|100)°\.", workbench.text("#likeliest-fov"))
    # Numbers of a first answer are marked as such, those of the last one are not.
    assert True in workbench.ask("return window.refining")
    assert not workbench.one("#refining").is_displayed()
    saved = workbench.ask("return semsig.session.saved().views[0].photos[0]")
    assert saved["fov"] is None
    workbench.choose("#fov-known", "known")
    assert workbench.ask("return semsig.session.scene.fov") in {40, 55, 70, 85, 100}
    assert workbench.ask("return semsig.session.answer.fov") is None


def test_place_has_a_name_links_and_a_short_credit(workbench: WorkbenchPage, page: Page) -> None:
    database = page.bench.database
    name = "return semsig.session.answer.place_name"
    workbench.press("#simulate")
    near = next(
        cell
        for cell in np.argsort(-database.lengths)
        if page.bench.store is not None and page.bench.store.place_name(*database.xy[cell])
    )
    place = to_latlon(database.xy[[near]], database.crs)[0].tolist()
    workbench.ask("semsig.map.fire('click', {latlng: L.latLng(...arguments)})", *place)
    workbench.until("return semsig.session.truth")
    sentence = workbench.settle()
    assert "Rue de l'École" in workbench.ask(name)
    assert f"({workbench.ask(name)})" in sentence
    links = workbench.all("#spot a")
    assert [link.text for link in links][:2] == ["OpenStreetMap", "Google Street View"]
    place = workbench.ask("return semsig.session.answer.candidates[0].place")
    addresses = [link.get_attribute("href") for link in links]
    assert addresses == list(place_links(*place).values())
    assert {link.get_attribute("rel") for link in links} == {"noopener noreferrer"}
    credit = workbench.text("#map .leaflet-control-attribution")
    assert credit.startswith("© Town")
    assert "\n" not in credit
    assert "Leaflet" in workbench.text("#about")


def test_camera_and_place_come_from_exif(
    workbench: WorkbenchPage, photos: list[StreetPhoto], page: Page, tmp_path: Path
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
    workbench.give("#photo", file)
    photo = workbench.ask("return semsig.session.scene")
    assert photo["fov"] == pytest.approx(63.4, abs=1)
    assert photo["heading"] == pytest.approx(180, abs=2)
    assert "as the photo says" in workbench.text("#camera legend")
    there = "const {lat, lng} = semsig.map.getCenter(); return [lat, lng]"
    assert workbench.ask(there) == pytest.approx(place.tolist(), abs=1e-4)
    workbench.mark(photos[0], 0)
    # Its place can be used.
    assert "--near" not in workbench.ask("return semsig.session.answer.command")
    entropy = workbench.ask("return semsig.session.answer.entropy")
    workbench.press("#near")
    workbench.settle()
    assert workbench.ask("return semsig.session.body().near") == [*photo["place"], 50]
    assert workbench.ask("return semsig.session.answer.entropy") < entropy
    workbench.one("#near-metres").send_keys(Keys.CONTROL, "a")
    workbench.type("20", Keys.ENTER)
    command = workbench.ask("return semsig.session.answer.command")
    near = command.split("--near ")[1].split()[0]
    assert near == f"{photo['place'][0]:.10g}N,{photo['place'][1]:.10g}E,20"
    assert workbench.ask("return semsig.session.saved().near") == [*photo["place"], 20]
    # A photo some steps on is another place of the same question.
    workbench.give("#photo-on", photos[1].file)
    workbench.mark(photos[1], 0)
    views = workbench.ask("return semsig.session.body().views")
    assert [len(view["photos"]) for view in views] == [1, 1]
    assert [element.text for element in workbench.all(".view small")] == ["Place 1", "Place 2"]
    # A mark and its object on the map select each other.
    assert len(workbench.all("#map .at.chosen")) == 1
    workbench.press("#map .at.chosen")
    assert workbench.all(f"{STAGE} .mark[aria-pressed=true]")


def test_next_question_is_shown_and_answered(
    workbench: WorkbenchPage, photos: list[StreetPhoto]
) -> None:
    workbench.give("#photo", photos[0].file)
    workbench.mark(photos[0], 0)
    first = workbench.question()
    assert re.fullmatch(r"Is there an?(other)? .* in view, within 30 m\?", first)
    workbench.press("#question button", "Don\u2019t know")
    second = workbench.question()
    assert second != first
    assert workbench.all("#question .absent button")[0].text.startswith("Not known: ")
    before = workbench.ask("return semsig.session.answer.entropy")
    workbench.press("#question button", "No")
    assert workbench.question() != second
    absent, _ = workbench.all("#question .absent button")
    assert absent.text.startswith("No ")
    assert workbench.ask("return semsig.session.answer.entropy") < before
    absent.click()
    workbench.settle()
    assert workbench.ask("return semsig.session.absent") == []
    # Without a reply no question is shown, and the answer remains.
    workbench.ask(
        "const own = window.fetch; window.fetch = (path, ...more) => { window.asked = path;"
        "return path.includes('suggest') ? Promise.reject(new TypeError('gone'))"
        " : own(path, ...more); }; window.restored = () => { window.fetch = own; };"
    )
    assert workbench.mark(photos[0], 1).startswith(("Cannot tell", "Within"))
    workbench.until("return window.asked.includes('suggest')")
    assert workbench.all("#question b") == []
    workbench.ask("restored()")
    workbench.mark(photos[0], 2)
    workbench.question()
    workbench.press("#question button", "Yes, I mark it")
    assert workbench.question().startswith("Click the ")
    class_name = workbench.ask("return semsig.session.next")
    workbench.drag(STAGE, (0.1, 0.1))
    assert workbench.ask("return semsig.session.entries.at(-1).class") == class_name
    assert not workbench.one("#classes").is_displayed()


def test_view_is_composed_on_a_compass(workbench: WorkbenchPage) -> None:
    workbench.press("#add-compass")
    workbench.brush("bench")
    workbench.drag(STAGE, (0.5, 0.3))
    workbench.drag(STAGE, (0.99, 0.5))
    entries = "return semsig.session.entries"
    north, east = workbench.ask(entries)
    assert (north["bearing"] % 360, east["bearing"]) == (pytest.approx(0, abs=2), 90)
    assert 5 < north["range"] < 20
    assert east["range"] is None
    workbench.drag(f"{STAGE} .mark[aria-pressed=true]", (0.5, 0.5), (-60, 60), (-20, 20))
    assert 100 < workbench.ask(entries)[1]["bearing"] < 180
    turned = workbench.ask(entries)[1]
    workbench.type(Keys.ARROW_RIGHT, Keys.ARROW_DOWN)
    assert workbench.ask(entries)[1]["bearing"] == turned["bearing"] + 5
    assert workbench.ask(entries)[1]["range"] < turned["range"]
    workbench.choose("#turn-seen", "part")
    workbench.one("#sector-0").clear()
    workbench.one("#sector-0").send_keys("300", Keys.TAB)
    workbench.settle()
    assert workbench.ask("return semsig.session.scene.sectors") == [[300, 45]]
    workbench.choose("#north", "unknown")
    assert workbench.ask("return semsig.session.answer.views[0].heading_error") == "unknown"
    # A second view some steps on; the answer is about the current view.
    workbench.press("#add-compass")
    workbench.press("#add-mark")
    workbench.one("#step-metres").clear()
    workbench.one("#step-metres").send_keys("15", Keys.TAB)
    workbench.settle()
    step = workbench.ask("return semsig.session.body().views[1].step")
    assert step == {"bearing": 0, "metres": 15}
    workbench.press(".tab")
    assert workbench.ask("return semsig.session.body().view") == 0
    # Marks are lost only after a confirmation, and not for good.
    workbench.one("[aria-label='Remove Compass']").click()
    workbench.browser.switch_to.alert.dismiss()
    assert len(workbench.all(".tab")) == 2
    workbench.one("[aria-label='Remove Compass']").click()
    workbench.browser.switch_to.alert.accept()
    workbench.settle()
    assert workbench.ask("return semsig.session.views[0].step") is None


# A second family, as of a city with more classes.
FAMILIES = """
const {session} = semsig;
const [bench, ...others] = session.city.classes;
bench.family = "shop";
bench.words = ["bakery", "boulangerie"];
const family = (name, heading) => ({...bench, symbol: undefined, name, heading, words: ["store"],
  title: `Any of ${heading.toLowerCase()}`});
session.city.families = [family("shop", "Shops"), family("furniture", "Street furniture")];
semsig.palette(session);
return [bench.name, bench.title];
"""


def test_classes_are_found_by_family_and_words_and_texts_are_kept(workbench: WorkbenchPage) -> None:
    name, title = workbench.ask(FAMILIES)
    workbench.press("#add-compass")
    workbench.ask("document.getElementById('several').open = true")
    headings = ["Seen most often", "Shops", "Street furniture"]
    assert [part.text for part in workbench.all("#palette summary")] == headings
    workbench.one("#palette-search").send_keys("boulang")
    assert [button.text for button in workbench.all("#palette button")] == [
        "Ask at each mark",
        title,
    ]
    workbench.one("#palette-search").clear()
    workbench.one("#palette-search").send_keys("store")
    workbench.brush("shop")
    workbench.press("#add-mark")
    marks = "return semsig.session.entries.map((entry) => [entry.class, entry.text ?? null])"
    assert workbench.ask(marks) == [["shop", None]]
    workbench.one("#text").send_keys("Boulangerie P", Keys.TAB)
    workbench.settle()
    assert workbench.ask(marks) == [["shop", "Boulangerie P"]]
    assert "\u201cBoulangerie P\u201d" in workbench.text("#marks")
    assert "Boulangerie P" in workbench.ask("return JSON.stringify(semsig.session.saved().views)")
    workbench.press("#undo")
    assert workbench.ask(marks) == [["shop", None]]
    workbench.press("#redo")
    assert workbench.ask(marks) == [["shop", "Boulangerie P"]]
    # The menu at a mark has the same families.
    workbench.ask("semsig.askClass(semsig.session, semsig.session.entries[0])")
    menu = workbench.ask(
        "return [...document.querySelectorAll('#class-list > *')].map((line) => line.textContent)"
    )
    assert menu[0] == "Seen most often"
    assert menu[menu.index("Shops") + 1 : menu.index("Street furniture")] == ["Any of shops", title]
    workbench.type(Keys.ESCAPE)
    assert name in workbench.ask("return semsig.kindsLike(semsig.session, 'bakery')[0].name")


def test_view_is_simulated_with_noise(workbench: WorkbenchPage, page: Page) -> None:
    database = page.bench.database
    place = to_latlon(database.xy[[PLACE]], database.crs)[0].tolist()
    click = "semsig.map.fire('click', {latlng: L.latLng(...arguments)})"
    workbench.ask(click, *place)  # does nothing before it is switched on
    workbench.press("#simulate")
    workbench.press("#again")
    assert workbench.text("#notice").startswith("Click a place on the map first")
    workbench.ask(click, *place)
    workbench.until("return semsig.session.truth")
    assert re.match("Found: the best place is .* rank 1. Within 50 m", workbench.settle())
    assert workbench.text("#notice") == ""
    whole = len(workbench.ask("return semsig.session.entries"))
    workbench.choose("#turn", "70")
    workbench.until("return semsig.session.scene.sectors")
    assert len(workbench.ask("return semsig.session.entries")) < whole
    # With noise, and with other seeds.
    workbench.choose("#spoil", "strong")
    views = set()
    for _ in range(3):
        before = workbench.ask("return semsig.session.views[0]")
        workbench.press("#again")
        workbench.until(
            "return JSON.stringify(semsig.session.views[0]) !== arguments[0]",
            json.dumps(before, separators=(",", ":"), ensure_ascii=False),
        )
        assert re.match("(Found|Wrong|Not found): ", workbench.settle())
        views.add(json.dumps(workbench.ask("return semsig.session.entries")))
    assert len(views) > 1
    # Marks by hand are only replaced after a confirmation.
    workbench.press("#new")
    workbench.press("#add-compass")
    workbench.ask(click, *place)
    workbench.browser.switch_to.alert.dismiss()
    assert workbench.ask("return semsig.session.truth") is None
    workbench.press("#simulate")
    assert not workbench.one("#spoiling").is_displayed()
    # The assumptions are part of the question.
    workbench.press("#add-mark")
    workbench.ask("document.getElementById('assumptions').open = true")
    workbench.choose("#noise", "light")
    workbench.choose("#from", "cells")
    body = workbench.ask("return semsig.session.body()")
    assert (body["noise"], body["seen_from"]) == ("light", "cells")


def test_invalid_photo_or_session_shows_a_notice(workbench: WorkbenchPage) -> None:
    for name, content in {
        "notes.jpg": b"only words",
        "drawing.svg": b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>',
        "phone.heic": b"\0\0\0\x18ftypheic\0\0\0\0heicmif1" + bytes(100),
        "large.jpg": bytes(26 * 2**20),
        "bomb.png": decompression_bomb(),
    }.items():
        workbench.give_new("#photo", name, content)
        assert re.fullmatch(rf".*{name}.*\.", workbench.notice())
        assert workbench.all(".tab") == []
        workbench.press("#notice button")
    assert not workbench.one("#notice").is_displayed()
    session = workbench.ask("return semsig.session.saved()")
    changes: list[tuple[dict[str, Any], str]] = [
        ({"version": 2}, "not a session"),
        ({"views": [{"photos": [{}]}]}, "The views of this session are not as"),
        ({"city": {"name": "elsewhere", "fingerprint": "0"}}, "elsewhere"),
    ]
    texts = [("{", "not a session")]
    texts += [(json.dumps({**session, **change}), word) for change, word in changes]
    for number, (text, word) in enumerate(texts):
        workbench.give_new("#open", f"session{number}.json", text)
        assert word in workbench.notice()
        workbench.press("#notice button")


# Puts each of some values at each place of a session, and opens it.
EDIT = """
const [saved] = arguments;
const values = [null, -1, 1e308, "x", true, [], {}, [null], [[{}]]];
const places = [];
const walk = (value, place) => {
  places.push(place);
  if (value instanceof Object) for (const key in value) walk(value[key], [...place, key]);
};
walk(saved, []);
const answers = new Set();
for (const place of places) {
  for (const value of values) {
    const copy = {all: structuredClone(saved)};
    const way = ["all", ...place];
    let part = copy;
    for (const key of way.slice(0, -1)) part = part[key];
    part[way.at(-1)] = value;
    try {
      semsig.session.restore(copy.all);
      answers.add("restored");
    } catch (error) {
      answers.add(error.message);
    }
  }
}
semsig.session.restore(saved);
return [places.length, [...answers]];
"""


def test_session_edited_by_hand_is_refused_or_shown(workbench: WorkbenchPage) -> None:
    mark = {"class": "bench", "range": "near", "text": "12a"}
    photo: dict[str, Any] = {
        "name": "a.jpg",
        "width": 400,
        "height": 300,
        "projection": "pinhole",
        "fov": 60,
    }
    photo |= {"heading": 10, "heading_error": 5, "place": [48.5, 3.0]}
    photo["marks"] = [mark | {"x": 10, "y": 20}, mark | {"box": [1, 2, 30, 40]}]
    compass = [mark | {"bearing": 5.0, "range": 12}]
    views: list[dict[str, Any]] = [
        {"photos": [photo], "step": None},
        {"compass": compass, "sectors": [[315, 45]], "heading_error": "unknown"},
    ]
    views[1]["step"] = {"bearing": 9.0, "metres": 1.0}
    session = workbench.ask("return semsig.session.saved()")
    session |= {"views": views, "near": [48.5, 3.0, 20], "absent": ["bench"], "truth": [48.5, 3.0]}
    session["answer"] = None
    places, answers = workbench.ask(EDIT, session)
    assert places > 60
    texts = {answer.split(" of this session")[0] for answer in answers if answer != "restored"}
    names = {f"The {name}" for name in ("views", "truth", "near", "seen_from", "absent", "noise")}
    assert {text for text in texts if not text.startswith("This ")} == names
    assert all(answer.endswith((".", "restored")) for answer in answers)
    assert len(workbench.all(".tab")) == 2


def test_detector_boxes_become_marks(workbench: WorkbenchPage, photos: list[StreetPhoto]) -> None:
    x0, y0, x1, y1 = photos[0].things[0][1]
    bench, dog = ("bench", [x0, y0, x1 - x0, y1 - y0], 0.9), ("dog", [1.0, 1.0, 40.0, 40.0], 0.9)
    workbench.give("#photo", photos[0].file)
    workbench.give_new("#boxes", "boxes.json", coco("ahead.jpg", (960, 720), bench, dog))
    (mark,) = workbench.until("return semsig.session.entries.length && semsig.session.entries")
    assert mark["class"] == "bench"
    assert workbench.settle().startswith(("Cannot tell", "Within"))
    # YOLO boxes with the list of labels.
    yolo, labels = (workbench.folder / name for name in ("ahead.txt", "classes.txt"))
    yolo.write_text("1 0.5 0.5 0.1 0.1 0.8\n", encoding="utf-8")
    labels.write_text("dog\nbench\n", encoding="utf-8")
    workbench.give("#boxes", yolo, labels)
    classes = [mark["class"] for mark in workbench.ask("return semsig.session.entries")]
    assert classes == ["bench", "bench"]
    workbench.give_new("#boxes", "boxes.json", "[")
    assert "boxes.json" in workbench.notice()


def test_hostile_text_from_files_stays_text(workbench: WorkbenchPage, tmp_path: Path) -> None:
    file = tmp_path / "a.jpg"
    Image.new("RGB", (40, 20)).save(file)
    workbench.give("#photo", file)
    workbench.until("return semsig.session.scene")
    session = workbench.ask("return semsig.session.saved()")
    photo = {**session["views"][0]["photos"][0], "name": HOSTILE, "sha256": "0"}
    session["views"] = [{"photos": [photo], "step": None}]
    workbench.give_new("#open", "session.json", json.dumps(session))
    workbench.until("return semsig.session.scene?.name !== 'a.jpg'")
    assert HOSTILE in workbench.text(".tab")
    assert workbench.all("#seen script, #seen img") == []


def test_dropped_files_are_read(workbench: WorkbenchPage, photos: list[StreetPhoto]) -> None:
    content = photos[0].file.read_bytes()
    workbench.ask(
        "const files = new DataTransfer();"
        "files.items.add(new File([new Uint8Array(arguments[0])], 'ahead.jpg'));"
        "files.items.add(new File(['['], 'boxes.json'));"
        "for (const kind of ['dragover', 'drop']) document.body.dispatchEvent(new DragEvent("
        "kind, {dataTransfer: files, bubbles: true, cancelable: true}));",
        list(content),
    )
    assert "boxes.json" in workbench.notice()
    assert [element.text for element in workbench.all(".tab")] == ["ahead.jpg"]
    # Colours are switched.
    workbench.press(".semsig-colours")
    assert workbench.all("body.dark")


def test_streets_are_drawn_and_streets_and_cells_found(
    workbench: WorkbenchPage, page: Page
) -> None:
    assert workbench.all("#map canvas.semsig-ground")
    search = ".semsig-search input"
    workbench.one(search).send_keys("ecole", Keys.ENTER)
    assert workbench.text(".leaflet-tooltip") == "Rue de l'École"
    workbench.one(search).clear()
    workbench.one(search).send_keys(str(page.bench.database.cell_ids[PLACE]), Keys.ENTER)
    database = page.bench.database
    place = to_latlon(database.xy[[PLACE]], database.crs)[0]
    there = "const {lat, lng} = semsig.map.getCenter(); return [lat, lng]"
    assert workbench.ask(there) == pytest.approx(place.tolist(), abs=1e-4)
    workbench.ask("semsig.map.fire('click', {latlng: semsig.map.getCenter()})")
    workbench.until("return !document.querySelector('.leaflet-tooltip')")


def test_stopped_server_shows_a_message(workbench: WorkbenchPage) -> None:
    workbench.ask("window.fetch = () => new Promise((_, fail) => { window.fail = fail; })")
    workbench.press("#add-compass")
    workbench.one("#add-mark").click()
    assert workbench.one("#answer").get_attribute("aria-busy") == "true"
    workbench.ask("fail(new TypeError('gone'))")
    assert "is semsig serve still running?" in workbench.settle()
    assert workbench.one("#answer").get_attribute("aria-busy") is None
