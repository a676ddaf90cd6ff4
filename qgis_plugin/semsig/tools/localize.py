"""Localize a query."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsFeature,
    QgsFeatureSink,
    QgsGeometry,
    QgsPointXY,
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterString,
    QgsVectorLayer,
    QgsWkbTypes,
)

from ..algorithm import (
    REGIONS,
    SemsigAlgorithm,
    advanced,
    area,
    choice,
    database,
    described,
    keep_style,
    layers_to_write,
    map_to_write,
    number,
    show_layers,
    style_layer,
    whole_number,
)
from ..answers import (
    CANDIDATE_FIELDS,
    PLACE_FIELDS,
    answer_lines,
    candidate_rows,
    parse_answer,
    place_row,
)
from ..arguments import (
    LIKELIHOOD,
    METHOD_HELP,
    METHODS,
    NOISES,
    command_line,
    require_likelihood,
)

if TYPE_CHECKING:
    from qgis.core import (
        QgsFields,
        QgsProcessingContext,
        QgsProcessingFeedback,
    )

    from ..algorithm import Definitions

__all__ = ["Localize"]

HEADINGS = ("known", "uncertain", "unknown")


class Localize(SemsigAlgorithm):
    """`semsig localize`."""

    NAME = "localize"
    TITLE = "3. Localize a query"
    TAGS = ("query", "where", "place", "candidates", "position")
    HELP = """
Finds where in the city a view was taken from: what is seen, clockwise from north, is compared with
the signature of every cell. Types without bearings, or bearings without types, are enough.

The likelihood method gives each candidate a chance, estimates the place between the centres of
cells with its uncertainty, and reports when it cannot decide. The other methods are from the paper;
they rank cells by a distance, and cells that look the same share a rank.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        types = QgsProcessingParameterString("TYPES", "Types", optional=True)
        bearings = QgsProcessingParameterString("BEARINGS", "Bearings (°)", optional=True)
        candidates = QgsProcessingParameterFeatureSink(
            "CANDIDATES", "Candidates", QgsProcessing.SourceType.TypeVectorPoint
        )
        place = QgsProcessingParameterFeatureSink(
            "PLACE", "Place", QgsProcessing.SourceType.TypeVectorPolygon, optional=True
        )
        return (
            database(),
            described(
                types,
                "Symbols of what is seen, clockwise from north, such as DDBL; ? where one is "
                "unknown. The paper's: B tree, C fountain, D street light, E indicator, "
                "G traffic light, H bike station, I public toilet, J car sharing, K taxi rank, "
                "L bench, M bus stop; a catalogue may have more.",
            ),
            described(
                bearings,
                "The direction of each object, in degrees clockwise from north, separated by "
                "commas, such as 10,80,200,310.",
            ),
            choice("METHOD", "Method", METHODS, METHOD_HELP),
            choice(
                "NOISE",
                "Detector",
                NOISES,
                "With likelihood, how much of what is seen may be wrong: light, medium, strong, or "
                "generic where that is not known, by-hand for what a person noted down.",
            ),
            choice("HEADING", "North", HEADINGS, "With likelihood, whether the north is known."),
            number(
                "HEADING_SIGMA",
                "North is off by (°)",
                10.0,
                (0.1, 180.0),
                "With likelihood and an uncertain north, the standard deviation.",
            ),
            area("With likelihood: polygons that the place lies in."),
            whole_number(
                "TOP",
                "Number of candidates",
                10,
                (1, 10_000),
                "How many places (with likelihood) or cells to list at most.",
            ),
            advanced(
                described(
                    QgsProcessingParameterString("REQUIRE", "A cell must see", optional=True),
                    "Such as M (a bus stop), 2B (two trees or more), B=0 (no tree), ?<=10 (ten "
                    "objects or fewer).",
                )
            ),
            described(candidates, "The best places or cells."),
            described(
                place,
                "With likelihood: the ellipse in which the place lies with a chance of 90 %, if "
                "the answer is right.",
            ),
            layers_to_write(
                "REGIONS",
                "Regions to search",
                "The parts of the city to search for the query, in a GeoPackage.",
                optional=True,
            ),
            advanced(
                number(
                    "SHARE",
                    "Chance that the regions contain",
                    None,
                    (0.01, 1.0),
                    "With likelihood: the regions are as large as needed to contain this chance, "
                    "0.9 by default.",
                )
            ),
            advanced(
                number(
                    "WITHIN",
                    "Around the regions (m)",
                    0.0,
                    (0.0, 100_000.0),
                    "Distance around their cells that is searched as well.",
                )
            ),
            map_to_write("A page for the browser with the chances and the candidates."),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig localize` and make layers of its answer."""
        page = self.file_out(parameters, "MAP", context)
        regions = str(self.parameterAsOutputLayer(parameters, "REGIONS", context) or "")
        method = self.text(parameters, "METHOD", context)
        heading = self.text(parameters, "HEADING", context)
        noise = self.text(parameters, "NOISE", context)
        if noise != NOISES[0]:
            require_likelihood(method, "Detector")
        if heading == "uncertain":
            heading = str(self.parameterAsDouble(parameters, "HEADING_SIGMA", context))
        if self.sink_file(parameters, "PLACE", context):
            require_likelihood(method, "Place")
        printed = self.call(
            command_line(
                "localize",
                self.file(parameters, "DATABASE", context),
                types=self.text(parameters, "TYPES", context),
                bearings=self.text(parameters, "BEARINGS", context),
                method=method,
                # With other methods, the command refuses this option.
                noise=noise if method == LIKELIHOOD else "",
                heading="" if heading == HEADINGS[0] else heading,
                area=self.polygons(parameters, "AREA", context, feedback),
                require=self.text(parameters, "REQUIRE", context),
                top=self.parameterAsInt(parameters, "TOP", context),
                map=page,
                out=regions,
                share=self.parameterAsDouble(parameters, "SHARE", context) or None,
                within=self.parameterAsDouble(parameters, "WITHIN", context),
                json=True,
            ),
            feedback,
        )
        answer = parse_answer(printed)
        crs = QgsCoordinateReferenceSystem()
        crs.createFromUserInput(answer["crs"])
        outputs: dict[str, Any] = {"MAP": page} if page else {}
        if regions:
            titles = {"regions": REGIONS}
            outputs["REGIONS"] = show_layers(context, regions, titles, group=self.TITLE)
        place = place_row(answer)
        if place is not None:
            outline, values = place
            ring = [QgsPointXY(x, y) for x, y in outline]
            rows = [(QgsGeometry.fromPolygonXY([ring]), values)]
            kind = QgsWkbTypes.Type.Polygon
            sink = self._layer(parameters, "PLACE", context, (PLACE_FIELDS, kind, crs), rows)
            outputs.update(sink)
        rows = [
            (QgsGeometry.fromPointXY(QgsPointXY(x, y)), values)
            for x, y, values in candidate_rows(answer)
        ]
        kind = QgsWkbTypes.Type.Point
        outputs.update(
            self._layer(parameters, "CANDIDATES", context, (CANDIDATE_FIELDS, kind, crs), rows)
        )
        for line in answer_lines(answer):
            feedback.pushInfo(line)
        return outputs

    def _layer(
        self,
        parameters: dict[str, Any],
        name: str,
        context: QgsProcessingContext,
        shape: tuple[dict[str, str], Any, QgsCoordinateReferenceSystem],
        rows: list[tuple[QgsGeometry, list[Any]]],
    ) -> dict[str, Any]:
        """Write a layer, if it is requested, and return it by the name of its parameter."""
        path = self.sink_file(parameters, name, context)
        if path:  # QGIS does not create folders
            Path(path).parent.mkdir(parents=True, exist_ok=True)
        fields, kind, crs = shape
        sink, source = self.parameterAsSink(parameters, name, context, _fields(fields), kind, crs)
        if sink is None:
            return {}
        for geometry, values in rows:
            feature = QgsFeature()
            feature.setGeometry(geometry)
            feature.setAttributes(values)
            if not sink.addFeature(feature, QgsFeatureSink.Flag.FastInsert):
                raise QgsProcessingException(self.writeFeatureError(sink, parameters, name))
        del sink  # closes the file
        keep_style(source, name.lower())
        style_layer(context, source, name.lower(), group=self.TITLE)
        return {name: source}


def _fields(types: dict[str, str]) -> QgsFields:
    """Return fields by type names that all versions of QGIS accept; Qt's type names differ."""
    query = "&".join(f"field={name}:{kind}" for name, kind in types.items())
    return QgsVectorLayer(f"None?{query}", "", "memory").fields()
