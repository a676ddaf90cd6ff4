"""Answers to the requests of the workbench page about a city, as plain values for JSON."""

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
    CHANCES,
    FULL_TURN,
    VERDICTS,
    InputError,
    SemsigError,
    UnknownNameError,
    class_signs,
    codes_by_family,
    family_named,
    nearest_name,
    place_links,
    read_table,
    wrap_degrees,
)
from semsig_gis.database import visible_objects_at
from semsig_gis.evaluation import CitySights, Sight, SimulatedDetector, prepare_chain
from semsig_gis.localization import (
    NOISES,
    IncrementalIndex,
    KnownPosition,
    LikelihoodMethod,
    make_locator,
    method_index,
    next_questions,
    position_prior,
    with_unplaced,
)
from semsig_gis.observation import (
    POSSIBLE_FOV,
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
from semsig_gis.output import (
    MAX_ZOOM,
    OUTLINES,
    RAYS,
    REGION_COLOURS,
    CellPixels,
    answer_drawing,
    city_image,
    corners_of,
    data_url,
    exact_latlon,
    export_answer,
    panel_signs,
    region_levels,
    to_metres,
)
from semsig_gis.serve.question import (
    MIDDLE_FOV,
    PageBoxes,
    PagePlace,
    PageSimulation,
    Question,
)
from semsig_gis.serve.reasons import class_shares, place_reasons
from semsig_gis.sources import words_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import City, ObjectStore, SignatureDatabase
    from semsig_gis.localization import (
        CellScores,
        LikelihoodIndex,
        LikelihoodLocator,
        Location,
        Noise,
        QuestionRecord,
    )
    from semsig_gis.serve.question import PagePhoto

MOST_UPLOAD = 25 * 2**20
"""Most bytes of a request: a picture or a question."""
PAGE_NOISE = "by-hand"
FORMATS = {
    "gpkg": "application/geopackage+sqlite3",
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
}
MARKS_TO_PREPARE = 5
QUICKLY_EXPLAINED = 3  # candidates of a quick answer
MOST_NAME = 40  # letters of a name in a message
PANORAMA_RATIO = 2  # width / height of a full panorama


@dataclass(eq=False, kw_only=True)
class Workbench:
    """A city, and the answers to the requests of a page about it.

    Parameters
    ----------
    city : City
        The city.
    store : ObjectStore or None
        Its street objects, if there are any.
    noises : mapping of str to Noise, default all named models, ``by-hand`` first
        Noise models that the page offers, by their ``--noise`` value for `semsig localize`; the
        first is the default.
    objects : Path, optional
        File of the street objects, if it is not the store of the city.
    """

    city: City
    store: ObjectStore | None
    noises: Mapping[str, Noise] = field(
        default_factory=lambda: {PAGE_NOISE: NOISES[PAGE_NOISE], **NOISES}
    )
    objects: Path | None = None
    _indexes: dict[tuple[str, str], LikelihoodIndex] = field(default_factory=dict)
    _last: tuple[object, tuple[Location, ...]] | None = None
    _scores: dict[str, CellScores] = field(default_factory=dict)
    _incremental: IncrementalIndex | None = None

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
        """Compute indexes and images that the first answers need."""
        _ = self.about
        longest = int(self.database.lengths.argmax())
        sight = Sight.of_cell(self.database, longest)
        marks = self._compass(sight)[:MARKS_TO_PREPARE]
        for error in (None, "unknown"):
            self.answer({"views": [{"compass": marks, "heading_error": error}]})

    @cached_property
    def about(self) -> dict[str, Any]:
        """The facts about the city that the page shows first."""
        database = self.database
        image, bounds = city_image(database)
        shares, occurrences = self._shares, database.occurrences
        signs = class_signs(database.taxonomy)
        ranges = database.taxonomy.ranges(database.spec.radius)
        # The classes that are seen most often come first.
        present = set(database.present_codes.tolist())
        kinds = sorted(
            (item for item in self.taxonomy.classes if item.code in present),
            key=lambda item: -int(occurrences[item.code]),
        )
        codes = [item.code for item in kinds if shares[item.code] > 0]
        groups = codes_by_family(self.taxonomy, codes)
        families = [
            {
                "name": name,
                "heading": family_named(name).title,
                "title": f"Any of {family_named(name).title.lower()}",
                "words": words_for(name),
                "colour": family_named(name).colour,
                "ink": "#ffffff",
                "pictogram": family_named(name).pictogram,
            }
            for name in groups
            if len(groups) > 1
        ]
        return {
            "name": self.city.path.stem,
            "fingerprint": self.city.digest,
            "cells": len(database),
            "crs": database.crs.to_string(),
            "radius": database.spec.radius,
            "reach": database.near_reach,
            "method": "likelihood",
            "noise": list(self.noises),
            "licences": list(self.city.licenses),
            # Without the layers, which the page lists apart.
            "credit": ", ".join(
                dict.fromkeys(line.partition(": ")[0] for line in self.city.licenses)
            ),
            "bounds": corners_of(database).tolist(),
            "image": {"url": data_url(image), "bounds": bounds},
            "classes": [
                {
                    "code": item.code,
                    "symbol": item.symbol,
                    "name": item.name,
                    "title": item.title,
                    "family": item.family,
                    "words": words_for(item.name),
                    "colour": signs[item.code].colour,
                    "ink": signs[item.code].ink,
                    "drop": signs[item.code].drop,
                    "shape": signs[item.code].shape,
                    "outline": OUTLINES[signs[item.code].shape],
                    "pictogram": signs[item.code].pictogram,
                    "range": float(ranges[item.code]),
                    "share": float(shares[item.code]),
                }
                for item in kinds
            ],
            "families": families,
            "signs": panel_signs(database),
            "verdicts": {
                verdict: {"colour": VERDICTS[verdict], "text": text, **look}
                for verdict, (text, look) in RAYS.items()
            },
            "fovs": [min(POSSIBLE_FOV), max(POSSIBLE_FOV)],
            "max_zoom": MAX_ZOOM,
            "max_upload": MOST_UPLOAD,
            "has_objects": self.store is not None,
        }

    def photo(self, content: bytes, name: str) -> dict[str, Any]:
        """Return camera and place of a picture, from its metadata; InputError if it is none."""
        shot = picture_shot(content, name)
        width, height = shot.size or (0, 0)
        panorama = not (shot.focal or shot.camera) and width == PANORAMA_RATIO * height
        # A picture of this ratio without a focal length is taken for a full panorama.
        if panorama:
            shot = replace(shot, camera="equirectangular")
        fov = field_of_view(shot)
        notes = []
        if panorama:
            notes.append("It is twice as wide as high, so it is treated as a full panorama.")
        elif shot.camera and fov:
            notes.append(f"It is a panorama of {fov:.0f}°, as it says itself.")
        heading = shot.heading
        if heading is not None and shot.travels:
            notes.append("Its direction is that of travel; correct it if you did not look ahead.")
        if heading is not None and shot.north is not None:
            crs, bounds = self.database.crs, self.database.bounds
            north = North.of("magnetic" if shot.north == "magnetic" else "true", crs, bounds)
            heading = float(wrap_degrees(heading + north.turn))
            notes.append(
                f"Its compass direction is {shot.heading:.0f}° from {shot.north} north, "
                f"± {shot.heading_error:g}°."
            )
        return {
            "sha256": hashlib.sha256(content).hexdigest(),
            "name": name,
            "width": width,
            "height": height,
            "projection": shot.camera or "pinhole",
            "fov": None if fov is None else round(fov, 2),
            "horizon": None if shot.horizon is None else round(shot.horizon * height, 1),
            "heading": None if heading is None else round(heading, 2),
            "heading_error": None if heading is None else shot.heading_error,
            "place": None if shot.position is None else list(shot.position),
            "notes": notes,
        }

    def boxes(self, body: object) -> dict[str, Any]:
        """Return the boxes of a detector's file as marks of the photos of the page."""
        request = read_table(PageBoxes, body, "the request", error=InputError)
        name = PurePosixPath(request.name or "boxes.json").name or "boxes.json"
        photos = {photo.name or "": photo for photo in request.photos}
        shots = {key: _shot(photo) for key, photo in photos.items()}
        stems = {PurePosixPath(key).stem: key for key in photos}
        # The readers of detections expect files, with the labels of YOLO next to the boxes.
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, name)
            try:
                file.write_text(request.text or "", encoding="utf-8")
                if request.classes:
                    Path(folder, "classes.txt").write_text(request.classes, encoding="utf-8")
            except (OSError, ValueError) as error:  # of a name such as "..", or half a character
                reason = getattr(error, "strerror", None) or "it is not Unicode"
                raise InputError(
                    f"the file {name[:MOST_NAME]!r} cannot be read ({reason}); give it a plain "
                    "name, and text in UTF-8."
                ) from error
            try:
                pictures, _ = read_pictures([file])
            except SemsigError as error:
                raise InputError(str(error).replace(f"{folder}/", "")) from error
        tally = Tally()
        builder = ViewBuilder(
            labels=LabelMap.open(request.labels or (), self.taxonomy),
            taxonomy=self.taxonomy,
            shots=shots | {stem: shots[key] for stem, key in stems.items()},
        )
        marks: dict[str, list[dict[str, Any]]] = {}
        for picture in pictures:
            # Files of detectors name pictures with other folders and suffixes.
            key = next((stems[name] for name in picture.names if name in stems), None)
            if key is not None:
                marks.setdefault(key, []).extend(self._marks(builder, picture, tally))
        if not marks:
            listed = ", ".join(sorted({picture.name for picture in pictures})[:3]) or "no picture"
            raise InputError(
                f"{name} contains boxes of {listed}, and none of these photos is open here; open "
                "them first."
            )
        ignored = (
            (tally.below_min_score, "with a low score"),
            (tally.unknown.total(), "with labels that are in no label map"),
            (tally.no_objects.total(), "of things that are not street objects"),
            (tally.not_in_city.total(), "of classes that the city does not have"),
        )
        notes = [f"Left out: {count:,} boxes {reason}." for count, reason in ignored if count]
        return {"photos": marks, "notes": notes}

    def _marks(self, builder: ViewBuilder, picture: Any, tally: Tally) -> list[dict[str, Any]]:  # noqa: ANN401
        """Return the boxes of a picture as marks of the page."""
        boxes = builder.located_boxes(picture, tally)
        names = {item.code: item.name for item in self.taxonomy.classes}
        turn = boxes.shot.heading or 0.0
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
                boxes.corners.tolist(),
                boxes.codes.tolist(),
                boxes.scores,
                boxes.bearings.tolist(),
                boxes.ranges.tolist(),
                boxes.range_errors.tolist(),
                strict=True,
            )
        ]

    def answer(self, body: object) -> dict[str, Any]:
        """Return the answer to a question as the page shows it."""
        start = time.perf_counter()
        question, location = self._located(body)
        drawing = answer_drawing(location)
        version = int(np.argmax(location.versions))
        marks = question.marks[version][question.place_number]
        table = self._index(question).table
        codes = {item.name: item.code for item in self.database.taxonomy.classes}
        for candidate in drawing["candidates"]:
            rays = candidate["rays"]
            for ray in rays:
                ray["mark"] = None if ray["query"] is None else list(marks[ray["query"]])
            name = None if location.city is None else location.city.place_name
            candidate["place_name"] = name and name(candidate["x"], candidate["y"])
            candidate["links"] = place_links(*candidate["place"])
            candidate["for_against"] = place_reasons(rays, codes, table=table, shares=self._shares)
        command = question.command(
            self.taxonomy,
            version,
            database=self.city.path,
            noise=self._noise(question),
            objects=self.objects,
        )
        return drawing | {
            "place_name": location.place,
            "links": location.links,
            "region": self._region(location),
            "truth": None if question.truth is None else self._truth(location, question.truth),
            "command": command,
            "views": question.rows(self.taxonomy, version),
            "fov": question.fovs[version] if question.fovs else None,
            "quick": self._is_quick(question),
            "seconds": time.perf_counter() - start,
        }

    def _region(self, location: Location) -> dict[str, Any]:
        """Return the regions of an answer, with an image of the city."""
        levels = region_levels(location.posterior)
        image, bounds = self._pixels.image(self._pixels.levels(levels), REGION_COLOURS, effort=1)
        return {
            "text": location.region_text,
            "image": data_url(image),
            "bounds": bounds,
            "counts": {
                f"{share:g}": int((levels >= level).sum())
                for level, share in enumerate(sorted(CHANCES, reverse=True), start=1)
            },
            "colours": {f"{share:g}": colour for share, colour in CHANCES.items()},
        }

    def _truth(self, location: Location, place: tuple[float, float]) -> dict[str, Any]:
        """Return the distance from the true place, and the rank and chance of its cell."""
        xy = to_metres(place, self.database.crs)
        (x, y), estimate = xy[0].tolist(), location.estimate
        metres = math.hypot(x - estimate.x, y - estimate.y)
        # The true place may be outside all cells, which gives -1.
        cell = int(self.database.cells_at(xy)[0])
        chances = location.chances
        return {
            "place": list(place),
            "metres": metres,
            "found": metres <= location.rule.radius,
            "rank": None if cell < 0 else int((chances > chances[cell]).sum()) + 1,
            "chance": None if cell < 0 else float(chances[cell]),
        }

    def export(self, body: object, suffix: str) -> bytes:
        """Return the answer to a question as the content of a file."""
        if suffix not in FORMATS:
            raise UnknownNameError(
                f"the format {suffix!r} is unknown; give one of {', '.join(FORMATS)}."
            )
        _, location = self._located(body)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, f"answer.{suffix}")
            ground = {} if self.store is None else self.store.ground
            export_answer(location, self.database, file, **ground)
            return file.read_bytes()

    def _noise(self, question: Question) -> str:
        """Return the name of the noise model of a question."""
        name = next(iter(self.noises)) if question.noise is None else question.noise
        return self._checked_noise(name)

    def _checked_noise(self, name: object) -> str:
        if not (isinstance(name, str) and name in self.noises):
            hint = nearest_name(str(name), self.noises)
            raise UnknownNameError(
                f"{name!r} is not a noise model here; give one of {', '.join(self.noises)}{hint}."
            )
        return name

    def _index(self, question: Question) -> LikelihoodIndex:
        """Return the index for a question, built on first use."""
        key = self._noise(question), question.seen_from
        if key not in self._indexes:
            self._indexes[key] = method_index(self.database, self._method(question))
        return self._indexes[key]

    def _method(self, question: Question) -> LikelihoodMethod:
        """Return the method of a question."""
        noise = self.noises[self._noise(question)]
        return LikelihoodMethod(noise=noise, on_grid=question.seen_from == "cells")

    def _locator(self, question: Question) -> LikelihoodLocator:
        """Return the locator for a question."""
        index = self._index(question)
        if self._incremental is None or self._incremental.index is not index:
            self._incremental = IncrementalIndex(index)
        locator = make_locator(
            self.database,
            self._method(question),
            index=index,
            store=self.store,
            top=question.top,
            explained=question.top,
        )
        if len(question.versions) == 1:
            locator = replace(locator, incremental=self._incremental)
        if self._is_quick(question):
            locator = replace(locator, refined=False, quick=True, explained=QUICKLY_EXPLAINED)
        if question.near is not None:
            place = KnownPosition.parse(question.near, self.database)
            prior = position_prior(self.database, (place.x, place.y), sigma=place.sigma)
            locator = replace(locator, log_prior=prior, surely_here=True)
            locator = replace(locator, known={"near": place.to_dict()})
        # Of an unknown field of view, what is absent is absent from the narrowest for sure.
        return with_unplaced(locator, question.versions[0][0], absent=question.absent)

    def _is_quick(self, question: Question) -> bool:
        """Whether the answer skips the slow steps, which only exist for places anywhere."""
        return question.quick and question.seen_from == "anywhere"

    def _located(self, body: object) -> tuple[Question, Location]:
        """Return a question and its answer; the last answer is cached."""
        question = Question.parse(body, taxonomy=self.taxonomy, radius=self.database.spec.radius)
        rows = [question.rows(self.taxonomy, version) for version in range(len(question.versions))]
        setting = self._noise(question), question.seen_from
        hints = question.absent, question.near
        key = rows, *setting, *hints, question.top, self._is_quick(question)
        if self._last is None or self._last[0] != key:
            locator = self._locator(question)
            # Reuse the scores of views that did not change since the last question.
            cache: dict[str, CellScores] = {}
            scores: list[list[CellScores]] = []
            firsts: list[CellScores] = []
            for views in question.versions:
                names = [json.dumps([*setting, view.to_dict(self.taxonomy)]) for view in views]
                scores.append([])
                for number, (name, view) in enumerate(zip(names, views, strict=True)):
                    # Hints are about the first place only.
                    view_hints, prior = ((), None) if number else (hints, locator.log_weights)
                    scanned = self._scores.get(name) or locator.scan(view)
                    score_key = json.dumps([name, view_hints, locator.quick])
                    best = self._scores.get(score_key)
                    best = best or locator.scores(view, prior, scanned=scanned)
                    cache |= {name: scanned, score_key: best}
                    scores[-1].append(best)
                firsts.append(cache[names[0]])
            self._scores = cache
            locations = locator.locate_versions(
                question.versions,
                question.legs,
                log_weights=question.log_weights,
                scores=scores,
                scanned=firsts,
            )
            self._last = key, locations
        return question, self._last[1][question.place_number]

    def suggest(self, body: object) -> list[QuestionRecord]:
        """Return what to look for next, with the largest expected gain first."""
        question, location = self._located(body)
        suggestions = next_questions(self._index(question), location, absent=question.absent)
        return [suggestion.to_dict() for suggestion in suggestions]

    def cell(self, body: object) -> dict[str, Any]:
        """Return the view from the middle of the cell at a place, and the number of like cells."""
        database = self.database
        request = read_table(PagePlace, body, "the request", error=InputError)
        _, cell = self._place(request)
        sight, types = Sight.of_cell(database, cell), database.type_sequences
        same_types = int((types.inverse == types.inverse[cell]).sum())
        return {
            "cell": int(database.cell_ids[cell]),
            "place": exact_latlon(database.xy[cell : cell + 1], database.crs)[0],
            "types": database.types(cell),
            "view": {"compass": self._compass(sight), "heading_error": None, "step": None},
            "distances": np.round(sight.distances, 1).tolist(),
            "alike": same_types - 1,
        }

    def _place(self, request: PagePlace) -> tuple[NDArray[np.float64], int]:
        """Return the place of a request in metres, and its cell."""
        place = to_metres(request.place, self.database.crs)
        cell = int(self.database.cells_at(place)[0])
        if cell < 0:
            raise InputError("there is no cell at that place; choose one that is shaded.")
        return place, cell

    def simulate(self, body: object) -> dict[str, Any]:
        """Return a simulated view from a place, with the errors of a noise model."""
        database = self.database
        request = read_table(PageSimulation, body, "the request", error=InputError)
        place, cell = self._place(request)
        sight = self._sight(place, cell)
        look: dict[str, Any] = {"sectors": None}
        if request.fov is not None:
            photo = Photo.looking(heading=request.heading or 0.0, fov=request.fov)
            sight = replace(sight, photo=photo)
            look = {"sectors": [[low, high % FULL_TURN] for low, high in photo.sectors] or None}
        # The true view, then the errors of a detector with this noise.
        chain = []
        if request.noise is not None:
            noise = self.noises[self._checked_noise(request.noise)]
            chain.append(SimulatedDetector(noise=noise))
        distorted = prepare_chain(chain, CitySights.of(database))(sight, request.seed, 0)
        return {
            "view": {
                "compass": self._compass(distorted),
                "heading_error": None,
                "step": None,
                **look,
            },
            "cell": int(database.cell_ids[cell]),
            "objects": len(sight),
            "truth": {"place": list(request.place)},
        }

    def _compass(self, sight: Sight) -> list[dict[str, Any]]:
        """Return the marks of a compass view with the objects of a sight."""
        names = {item.code: item.name for item in self.taxonomy.classes}
        return [
            {"class": names[code], "bearing": round(bearing, 2) % FULL_TURN, "range": None}
            for code, bearing in zip(sight.codes.tolist(), sight.bearings.tolist(), strict=True)
        ]

    def _sight(self, place: NDArray[np.float64], cell: int) -> Sight:
        """Return the true view from a place, or without objects from the middle of its cell."""
        if self.store is None:
            return Sight.of_cell(self.database, cell)
        views = visible_objects_at(
            self.store.objects,
            place,
            index=self.store.index,
            radius=self.database.spec.radius,
            footprints=self.store.buildings_around(
                place, distance=self.database.near_reach, occlusion=self.database.occlusion
            ),
        )
        return Sight(codes=views.codes, bearings=views.bearings, distances=views.distances)


def _shot(photo: PagePhoto) -> Shot:
    """Return the camera and heading of a photo of the page."""
    camera = photo.camera(MIDDLE_FOV)
    return Shot(
        camera=camera.projection,
        fov=camera.fov,
        heading=photo.heading,
        horizon=None if photo.horizon is None else photo.horizon / camera.height,
        size=(camera.width, camera.height),
    )
