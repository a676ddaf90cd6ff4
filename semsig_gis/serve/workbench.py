"""What the page of the workbench asks of a city, answered in plain values for JSON."""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    FULL_TURN,
    SHADES,
    VERDICTS,
    InputError,
    SemsigError,
    UnknownNameError,
    class_signs,
    nearest_name,
    wrap_degrees,
)
from semsig_gis.database import visible_objects_at
from semsig_gis.evaluation import CitySights, Sight, ready_chain
from semsig_gis.evaluation import Detector as FailingDetector
from semsig_gis.exports import export_answer
from semsig_gis.localization import (
    NOISES,
    KnownPosition,
    LikelihoodMethod,
    TurnMemo,
    make_locator,
    method_index,
    next_questions,
    position_prior,
    with_unplaced,
)
from semsig_gis.maps import (
    MAX_ZOOM,
    OUTLINES,
    RAYS,
    CellPixels,
    city_image,
    corners_of,
    data_url,
    exact_latlon,
    panel_signs,
    to_metres,
)
from semsig_gis.observation import (
    LabelMap,
    North,
    Photo,
    Shot,
    Tally,
    ViewBuilder,
    field_of_view,
    picture_shot,
    read_pictures,
    with_heights,
)
from semsig_gis.serve.drawing import answer_drawing, class_shares
from semsig_gis.serve.question import Question, camera_of, degrees, number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import City, ObjectStore, SignatureDatabase
    from semsig_gis.localization import (
        CellScores,
        LikelihoodIndex,
        LikelihoodLocator,
        Location,
        Noise,
    )

MOST_UPLOAD = 25 * 2**20
"""Bytes of a picture, or of a question."""
USUAL, PLAIN = "by-hand", "generic"
"""The noise models of the page and of `semsig localize` where none is chosen."""
FORMATS = {
    "gpkg": "application/geopackage+sqlite3",
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
}
MARKS_TO_PREPARE = 5
QUICKLY_EXPLAINED = 3
PANORAMA = 2  # times as wide as high


@dataclass(eq=False, kw_only=True)
class Workbench:
    """A city, and what answers the questions of a page about it.

    Parameters
    ----------
    city : City
        The city.
    store : ObjectStore or None
        Its street objects, if they are known.
    noises : mapping of str to Noise, default those that have a name, that of marks by hand first
        What the page may choose from, as ``--noise`` of `semsig localize` takes it; the first is
        taken where it chooses none.
    options : sequence of str, default the file of the city
        The database and other options, as `semsig localize` takes them.
    """

    city: City
    store: ObjectStore | None
    noises: Mapping[str, Noise] = field(default_factory=lambda: {USUAL: NOISES[USUAL], **NOISES})
    options: Sequence[str] = ()
    _indexes: dict[tuple[str, str], LikelihoodIndex] = field(default_factory=dict)
    _last: tuple[object, tuple[Location, ...]] | None = None
    _scores: dict[str, CellScores] = field(default_factory=dict)
    _memo: TurnMemo = field(default_factory=TurnMemo)

    @property
    def database(self) -> SignatureDatabase:
        """The cells."""
        return self.city.database

    @cached_property
    def taxonomy(self) -> Taxonomy:
        """The classes of the city, with the heights of the built-in ones."""
        return with_heights(self.database.taxonomy)

    @cached_property
    def _pixels(self) -> CellPixels:
        return CellPixels.of(self.database)

    @cached_property
    def _shares(self) -> NDArray[np.float64]:
        return class_shares(self.database)

    def prepare(self) -> None:
        """Load what the first answers need."""
        self.about()
        fullest = int(self.database.lengths.argmax())
        sight = Sight.of_cell(self.database, fullest)
        marks = self._compass(sight)[:MARKS_TO_PREPARE]
        for error in (None, "unknown"):
            self.answer({"views": [{"compass": marks, "heading_error": error}]})

    def about(self) -> dict[str, Any]:
        """Return what the page shows of the city before anything is asked."""
        return self._about

    @cached_property
    def _about(self) -> dict[str, Any]:
        database = self.database
        image, bounds = city_image(database, SHADES)
        shares = self._shares
        signs = class_signs(database.taxonomy)
        ranges = database.taxonomy.ranges(database.spec.radius)
        # A class that half of the cells see tells most, seen or not.
        present = set(database.present_codes.tolist())
        kinds = sorted(
            (item for item in self.taxonomy.classes if item.code in present),
            key=lambda item: abs(shares[item.code] - 0.5),
        )
        return {
            "name": self.city.path.stem,
            "fingerprint": self.city.digest,
            "cells": len(database),
            "crs": database.crs.to_string(),
            "radius": database.spec.radius,
            "reach": database.reach,
            "method": "likelihood",
            "noise": list(self.noises),
            "licences": list(map(str, database.licenses)),
            "bounds": corners_of(database).tolist(),
            "image": {"url": data_url(image), "bounds": bounds},
            "classes": [
                {
                    "code": item.code,
                    "symbol": item.symbol,
                    "name": item.name,
                    "title": item.title,
                    "colour": signs[item.code].colour,
                    "ink": signs[item.code].ink,
                    "drop": signs[item.code].drop,
                    "shape": signs[item.code].shape,
                    "outline": OUTLINES[signs[item.code].shape],
                    "range": float(ranges[item.code]),
                    "share": float(shares[item.code]),
                }
                for item in kinds
            ],
            "signs": panel_signs(database),
            "verdicts": {
                verdict: {"colour": VERDICTS[verdict], "text": text, **look}
                for verdict, (text, look) in RAYS.items()
            },
            "max_zoom": MAX_ZOOM,
            "max_upload": MOST_UPLOAD,
            "has_objects": self.store is not None,
        }

    def photo(self, content: bytes, name: str) -> dict[str, Any]:
        """Return what a picture says of its camera; InputError if it is none."""
        shot = picture_shot(content, name)
        width, height = shot.size or (0, 0)
        panorama = shot.focal is None and width == PANORAMA * height
        if panorama:
            shot = replace(shot, camera="equirectangular")
        fov = field_of_view(shot)
        notes = []
        if panorama:
            notes.append("It is twice as wide as high, so it is treated as a full panorama.")
        heading = shot.heading
        if heading is not None and shot.north is not None:
            crs, bounds = self.database.crs, self.database.bounds
            north = North.of("magnetic" if shot.north == "magnetic" else "true", crs, bounds)
            heading = float(wrap_degrees(heading + north.turn))
            notes.append(
                f"Its compass says that it looks at {shot.heading:.0f}° from {shot.north} north, "
                f"give or take {shot.heading_error:g}°."
            )
        return {
            "sha256": hashlib.sha256(content).hexdigest(),
            "name": name,
            "width": width,
            "height": height,
            "projection": shot.camera or "pinhole",
            "fov": None if fov is None else round(fov, 2),
            "heading": None if heading is None else round(heading, 2),
            "heading_error": None if heading is None else shot.heading_error,
            "place": None if shot.position is None else list(shot.position),
            "notes": notes,
        }

    def boxes(self, told: Mapping[str, Any]) -> dict[str, Any]:
        """Return the boxes of a detector's file, as marks of the photos that the page shows."""
        name = PurePosixPath(str(told.get("name") or "boxes.json")).name or "boxes.json"
        photos = {str(photo.get("name")): photo for photo in told.get("photos") or []}
        shots = {key: _shot(photo) for key, photo in photos.items()}
        stems = {PurePosixPath(key).stem: key for key in photos}
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, name)
            file.write_text(str(told.get("text") or ""), encoding="utf-8")
            if names := told.get("classes"):
                Path(folder, "classes.txt").write_text(str(names), encoding="utf-8")
            try:
                pictures = read_pictures([file])
            except SemsigError as error:
                raise InputError(str(error).replace(f"{folder}/", "")) from error
        tally = Tally()
        detector = ViewBuilder(
            labels=LabelMap.open(told.get("labels") or (), self.taxonomy),
            taxonomy=self.taxonomy,
            shots=shots | {stem: shots[key] for stem, key in stems.items()},
        )
        found: dict[str, list[dict[str, Any]]] = {}
        for picture in pictures:
            key = stems.get(PurePosixPath(picture.name).stem)
            if key is not None:
                found.setdefault(key, []).extend(self._marks(detector, picture, tally))
        if not found:
            listed = ", ".join(sorted({picture.name for picture in pictures})[:3]) or "no picture"
            raise InputError(
                f"{name} has boxes of {listed}, and none of these photos is open here; open them "
                "first."
            )
        return {"photos": found, "notes": _left_out(tally)}

    def _marks(self, detector: ViewBuilder, picture: Any, tally: Tally) -> list[dict[str, Any]]:  # noqa: ANN401
        seen = detector.located_boxes(picture, tally)
        names = {item.code: item.name for item in self.taxonomy.classes}
        turn = seen.shot.heading or 0.0
        return [
            {
                "box": [round(side, 1) for side in corners],
                "class": names.get(code, "?"),
                "score": float(scores[code]),
                "bearing": round((turn + bearing) % FULL_TURN, 2),
                "range": None if math.isnan(metres) else round(metres, 2),
                "range_error": None if math.isnan(metres) else round(error, 3),
            }
            for corners, code, scores, bearing, metres, error in zip(
                seen.corners.tolist(),
                seen.codes.tolist(),
                seen.scores,
                seen.bearings.tolist(),
                seen.ranges.tolist(),
                seen.range_errors.tolist(),
                strict=True,
            )
        ]

    def answer(self, told: object) -> dict[str, Any]:
        """Return the answer to a question, and all that the page draws of it."""
        start = time.perf_counter()
        question, location = self._located(told)
        table = self._index(question).table
        drawing = answer_drawing(
            location, question, table=table, shares=self._shares, pixels=self._pixels
        )
        noise = self._noise(question)
        options = [*(self.options or [str(self.city.path)])]
        options += [] if noise == PLAIN else ["--noise", noise]
        return drawing | {
            "command": question.command(self.taxonomy, options=options),
            "views": question.rows(self.taxonomy),
            "quick": self._is_quick(question),
            "seconds": time.perf_counter() - start,
        }

    def export(self, told: object, suffix: str) -> bytes:
        """Return the answer to a question as a file."""
        if suffix not in FORMATS:
            raise UnknownNameError(
                f"the format {suffix!r} is unknown; give one of {', '.join(FORMATS)}."
            )
        _, location = self._located(told)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, f"answer.{suffix}")
            export_answer(location, self.database, file)
            return file.read_bytes()

    def _noise(self, question: Question) -> str:
        """Return the name of the noise model of a question."""
        name = next(iter(self.noises)) if question.noise is None else question.noise
        return self._known_noise(name)

    def _known_noise(self, name: object) -> str:
        if not (isinstance(name, str) and name in self.noises):
            hint = nearest_name(str(name), self.noises)
            raise UnknownNameError(
                f"{name!r} is not a noise model here; give one of {', '.join(self.noises)}{hint}."
            )
        return name

    def _index(self, question: Question) -> LikelihoodIndex:
        """Return what views of a question are compared with."""
        key = self._noise(question), question.seen_from
        if key not in self._indexes:
            self._indexes[key] = method_index(self.database, self._method(question))
        return self._indexes[key]

    def _method(self, question: Question) -> LikelihoodMethod:
        """Return the method of a question."""
        noise = self.noises[self._noise(question)]
        return LikelihoodMethod(noise=noise, on_grid=question.seen_from == "cells")

    def _locator(self, question: Question) -> LikelihoodLocator:
        """Return what answers a question."""
        locator = make_locator(
            self.database,
            self._method(question),
            index=self._index(question),
            store=self.store,
            top=question.top,
            explained=question.top,
        )
        locator = replace(locator, memo=self._memo)
        if self._is_quick(question):
            locator = replace(locator, refined=False, quick=True, explained=QUICKLY_EXPLAINED)
        if question.near is not None:
            place = KnownPosition.parse(question.near, self.database)
            prior = position_prior(self.database, (place.x, place.y), sigma=place.sigma)
            locator = replace(locator, log_prior=prior, known={"near": place.to_dict()})
        return with_unplaced(locator, question.views[0], absent=question.absent)

    def _is_quick(self, question: Question) -> bool:
        """Tell whether an answer leaves out what takes long, and there is something to leave."""
        return question.quick and question.seen_from == "anywhere"

    def _located(self, asked: object) -> tuple[Question, Location]:
        """Return a question and its answer, which is found once."""
        question = Question.parse(asked, taxonomy=self.taxonomy, radius=self.database.spec.radius)
        rows = question.rows(self.taxonomy)
        setting = self._noise(question), question.seen_from
        hints = question.absent, question.near
        key = rows, *setting, *hints, question.top, self._is_quick(question)
        if self._last is None or self._last[0] != key:
            locator = self._locator(question)
            # Views that did not change are not compared with the city again.
            kept: dict[str, CellScores] = {}
            scores: list[CellScores] = []
            names = [json.dumps([*setting, view.to_dict(self.taxonomy)]) for view in question.views]
            for number, (name, view) in enumerate(zip(names, question.views, strict=True)):
                told, prior = ((), None) if number else (hints, locator.log_prior)
                scanned = self._scores.get(name) or locator.scan(view)
                ranked = json.dumps([name, told, locator.quick])
                best = self._scores.get(ranked) or locator.scores(view, prior, scanned=scanned)
                kept |= {name: scanned, ranked: best}
                scores.append(best)
            self._scores = kept
            views, first = question.views, kept[names[0]]
            if question.legs:
                locations = locator.locate_route(views, question.legs, scores=scores, scanned=first)
            else:
                locations = (locator.locate(views[0], scores=scores[0], scanned=first),)
            self._last = key, locations
        return question, self._last[1][question.shown]

    def suggest(self, told: object) -> list[dict[str, Any]]:
        """Return what to look for next, what is expected to tell most first."""
        question, location = self._located(told)
        questions = next_questions(self._index(question), location, absent=question.absent)
        return [one.to_dict() for one in questions]

    def cell(self, told: Mapping[str, Any]) -> dict[str, Any]:
        """Return what is seen from the middle of the cell at a place, and how many see alike."""
        database = self.database
        _, _, cell = self._there(told)
        sight, types = Sight.of_cell(database, cell), database.type_sequences
        alike = int((types.inverse == types.inverse[cell]).sum()) - 1
        return {
            "cell": int(database.cell_ids[cell]),
            "place": exact_latlon(database.xy[cell : cell + 1], database.crs)[0],
            "types": database.types(cell),
            "view": {"compass": self._compass(sight), "heading_error": None, "step": None},
            "distances": np.round(sight.distances, 1).tolist(),
            "alike": alike,
        }

    def _there(self, told: Mapping[str, Any]) -> tuple[list[float], NDArray[np.float64], int]:
        """Return a place in degrees and in metres, and its cell."""
        lat, lon = degrees(told.get("place"))
        place = to_metres((lat, lon), self.database.crs)
        cell = int(self.database.cells_at(place)[0])
        if cell < 0:
            raise InputError("there is no cell at that place; choose one that is shaded.")
        return [lat, lon], place, cell

    def simulate(self, told: Mapping[str, Any]) -> dict[str, Any]:
        """Return what would be seen from a place, and spoiled as a noise model says, as a view."""
        database = self.database
        latlon, place, cell = self._there(told)
        sight = self._sight(place, cell)
        look: dict[str, Any] = {"sectors": None}
        if (fov := told.get("fov")) is not None:
            heading = number(told.get("heading") or 0.0, "a heading", most=FULL_TURN)
            photo = Photo.looking(
                heading=heading, fov=number(fov, "a field of view", most=FULL_TURN)
            )
            sight = replace(sight, photo=photo)
            look = {"sectors": [[low, high % FULL_TURN] for low, high in photo.sectors] or None}
        noise = told.get("noise")
        chain = []
        if noise is not None:
            chain.append(FailingDetector(noise=self.noises[self._known_noise(noise)]))
        seed = told.get("seed", 0)
        if not isinstance(seed, int) or not 0 <= seed <= 10**18:
            raise InputError(f"a seed was given as {seed!r}; give a whole number from 0 to 10**18.")
        seen = ready_chain(chain, CitySights.of(database))(sight, seed, 0)
        return {
            "view": {
                "compass": self._compass(seen),
                "heading_error": None,
                "step": None,
                **look,
            },
            "cell": int(database.cell_ids[cell]),
            "objects": len(sight),
            "truth": {"place": latlon},
        }

    def _compass(self, seen: Sight) -> list[dict[str, Any]]:
        """Return what is seen as the page composes it."""
        names = {item.code: item.name for item in self.taxonomy.classes}
        return [
            {"class": names[code], "bearing": round(bearing, 2) % FULL_TURN, "range": None}
            for code, bearing in zip(seen.codes.tolist(), seen.bearings.tolist(), strict=True)
        ]

    def _sight(self, place: NDArray[np.float64], cell: int) -> Sight:
        """Return what is seen from a place, or from the middle of its cell."""
        if self.store is None:
            return Sight.of_cell(self.database, cell)
        views = visible_objects_at(
            self.store.objects,
            place,
            index=self.store.index,
            radius=self.database.spec.radius,
            footprints=self.store.buildings_around(place, distance=self.database.reach),
        )
        return Sight(codes=views.codes, bearings=views.bearings, distances=views.distances)


def _shot(photo: Mapping[str, Any]) -> Shot:
    """Return what the page knows of a photo."""
    camera = camera_of(photo)
    heading = photo.get("heading")
    return Shot(
        camera=camera.projection,
        fov=camera.fov,
        heading=None if heading is None else number(heading, "a heading", most=FULL_TURN),
        size=(camera.width, camera.height),
    )


def _left_out(tally: Tally) -> list[str]:
    """Return what there is to say of boxes that are no marks."""
    told = (
        (tally.below_min_score, "with a low score"),
        (tally.unknown.total(), "with labels that are in no label map"),
        (tally.no_objects.total(), "of things that are not street objects"),
        (tally.not_in_city.total(), "of classes that the city does not have"),
    )
    return [f"Left out: {count:,} boxes {what}." for count, what in told if count]
