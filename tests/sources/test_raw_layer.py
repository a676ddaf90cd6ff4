"""From rows to a layer: which CRS, what values of fields say, and how wide streets are."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused

from semsig_gis.core import CatalogError, crs_label
from semsig_gis.sources import (
    ClassBy,
    LayerSpec,
    RowRules,
    Rows,
    WidthBy,
    off_the_globe,
    reader,
    usable_crs,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.sources import FilteredRows, RawLayer


DATA = Path(__file__).with_name("data")
LAMBERT = (DATA / "esri.prj").read_text(encoding="utf-8")
SHIFTED = LAMBERT.replace("700000.0", "700001.0")
PLANE = 'LOCAL_CS["Undefined Cartesian SRS",UNIT["metre",1],AXIS["X",EAST],AXIS["Y",NORTH]]'
UNDEFINED = (
    'GEOGCS["Undefined geographic SRS",DATUM["unknown",SPHEROID["unknown",6378137,298.25]],'
    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]'
)


def test_esri_wkt_becomes_the_epsg_code() -> None:
    crs, near = usable_crs(LAMBERT), usable_crs(SHIFTED)
    assert crs == CRS.from_epsg(2154)
    assert near == CRS.from_wkt(SHIFTED)  # which only resembles a code
    assert crs is not None
    assert near is not None
    assert (crs_label(crs), crs_label(near)) == ("EPSG:2154", "RGF93_Lambert_93")


@pytest.mark.parametrize(
    "wkt", ["", " ", "nonsense", PLANE, UNDEFINED, LAMBERT.replace("GCS_RGF_1993", "")]
)
def test_wkt_without_a_place_on_earth_is_ignored(wkt: str) -> None:
    assert usable_crs(wkt) is None


def test_limits_apply_only_to_degrees() -> None:
    xy = np.array([[180.0, 90.0], [-180.0, -90.0], [180.1, 0.0], [0.0, -90.1], [4e5, 6e6]])
    assert off_the_globe(xy, CRS.from_epsg(4326)).tolist() == [False, False, True, True, True]
    for limitless in (2154, 4807):  # in metres, and in gons
        assert not off_the_globe(xy, CRS.from_epsg(limitless)).any()


def apply(spec: LayerSpec, **columns: Sequence[object]) -> FilteredRows:
    """Return what the rules of a layer make of rows with these fields."""
    rules = RowRules(spec, list(columns), filters=True, where="here")
    rows = Rows.of(rules.fields)
    for number, row in enumerate(zip(*columns.values(), strict=True), start=1):
        rows.add(dict(zip(columns, row, strict=True)), str(number), (0.0, 0.0))
    return rules.apply(rows)


def column(name: str, spec: LayerSpec, /, **columns: Sequence[object]) -> list[Any]:
    values: list[Any] = apply(spec, **columns).columns[name].to_pylist()
    return values


@given(st.integers(-(2**53), 2**53))
def test_whole_identifiers_have_no_decimals(number: int) -> None:
    spec = LayerSpec(name="things", class_name="bench", id_field="n")
    same = [number, float(number), str(number), f"{number}.0", f" {number}.00 "]
    ids = column("source_id", spec, n=[*same, None, "", "  "])
    assert ids == [str(number)] * 5 + ["6", "7", "8"]


def test_unlisted_values_of_class_by_are_left_out_and_noted() -> None:
    """Waste baskets do not become benches because nobody listed them."""
    by = ClassBy("kind", (("bench", "bench"), ("/stop.*/", "bus_stop")))
    kinds = [*["bin"] * 9, *["box", None] * 2, "bench", "stop 1", "\x1b[31m"]
    layer = apply(LayerSpec(name="things", class_name="", class_by=by), kind=kinds)
    assert layer.columns["class_name"].to_pylist() == ["bench", "bus_stop"]
    assert (layer.filtered, layer.excluded) == (14, 0)
    values = "'bin' 9, 'box' 2, no value 2, '\\x1b[31m' 1"
    assert layer.notes == (f"left out, unlisted in class_by 'kind': {values}",)
    spec = LayerSpec(name="things", class_name="bench", class_by=by)
    note = apply(spec, kind=kinds).notes[0]
    assert note.endswith('; write otherwise = "class" to take them as bench')
    spec = replace(spec, class_by=replace(by, otherwise=True))
    names = column("class_name", spec, kind=kinds)
    assert names == [*["bench"] * 14, "bus_stop", "bench"]
    many = apply(LayerSpec(name="things", class_name="", class_by=by), kind=[*map(str, range(20))])
    assert many.notes[0].endswith("'7' 1, and 12 others")


def test_values_of_class_by_are_not_comparisons() -> None:
    by = ClassBy("height", (("<2 m", "bench"), ("none", "bus_stop")))
    layer = apply(LayerSpec(name="a", class_name="", class_by=by), height=["<2 m", "none", None])
    assert layer.columns["class_name"].to_pylist() == ["bench", "bus_stop"]


def test_row_is_counted_by_the_first_reason() -> None:
    spec = LayerSpec(
        name="things",
        class_name="bench",
        where=(("height", (">=2 or none",)),),
        exclusions=(("state", ("gone", "/plan.*/")), ("depth", (">0",))),
    )
    layer = apply(
        spec,
        height=[2.5, None, 1.0, 3.0, 3.0, 2.0],
        state=["gone", "planned", "gone", None, "there", ""],
        depth=[1.0, 0.0, 0.0, 0.5, None, -1.0],
    )
    assert layer.numbers.tolist() == [5, 6]
    assert (layer.filtered, layer.excluded) == (1, 3)
    assert layer.notes == ("left out by the catalogue's not: state 2, depth 1",)


def test_invalid_pattern_is_refused() -> None:
    spec = LayerSpec(name="things", class_name="bench", where=(("kind", ("/[/",)),))
    with refused(CatalogError, "layer 'things'", "/[/", "regular expression"):
        RowRules(spec, ["kind"], filters=True, where="layer 'things'")


BY_CLASS = WidthBy("highway", (("primary", 24.0), ("/.*_link/", 14.0)), 12.0)


def street(**what: Any) -> LayerSpec:  # noqa: ANN401 - any field of a LayerSpec
    return LayerSpec(**{"name": "streets", "class_name": "", "role": "streets", **what})


def half_width(spec: LayerSpec, **row: object) -> float:
    columns = apply(spec, **{name: [value] for name, value in row.items()}).columns.to_pydict()
    return float(columns.get("half_width", [math.nan])[0])


ODD_WIDTHS = (True, 0, 0.05, -3, math.nan, math.inf, 201, "wide", "", None, "9'")


@pytest.mark.parametrize(
    ("by", "highway", "width", "half"),
    [
        (BY_CLASS, "primary", None, 12.0),
        (BY_CLASS, "trunk_link", None, 7.0),
        (BY_CLASS, None, None, 6.0),
        *((BY_CLASS, "road", odd, 6.0) for odd in ODD_WIDTHS),
        (WidthBy("highway", (("primary", 24.0),)), "road", None, math.nan),
        (None, "primary", None, math.nan),
        # A field of widths goes before the class.
        *((BY_CLASS, "primary", width, 4.75) for width in (9.5, "9.5", "9,5 m", "9.5m")),
        (None, "primary", 9, 4.5),
    ],
)
def test_width_is_from_the_field_or_the_class(
    by: WidthBy | None, highway: str | None, width: object, half: float
) -> None:
    spec = street(width_by=by, width_field="width")
    assert half_width(spec, highway=highway, width=width) == pytest.approx(half, nan_ok=True)
    if width is None:
        spec = street(width_by=by)
        assert half_width(spec, highway=highway) == pytest.approx(half, nan_ok=True)


@given(st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text())
def test_implausible_width_is_unknown(value: Any) -> None:  # noqa: ANN401
    half = half_width(street(width_field="width"), width=value)
    assert math.isnan(half) or 0.05 <= half <= 100


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("vector_file", "streets.geojson"),
        ("osm_file", "streets.osm"),
        ("overpass", "streets.json"),
        ("opendatasoft", "streets.geojson"),
    ],
)
def test_every_reader_returns_widths_and_names_of_streets(name: str, file: str) -> None:
    bare = street(geometry="line", tags=((("highway", ("*",)),),))
    unknown = replace(bare, width_field="width")
    spec = replace(unknown, width_by=BY_CLASS, name_field="highway")
    whole, half, none = (reader(name)(DATA / file, [s])[0] for s in (spec, unknown, bare))
    assert whole.table["half_width"].tolist() == [12.0, 4.0]
    assert (whole.notes, whole.table["half_width"].dtype) == ((), "float64")
    assert half.notes == ("1 of 2 streets have no known width",)
    assert [bool(name) for name in whole.table["name"]] == [True, True]
    assert not {"half_width", "name"} & {*none.table}


def test_missing_name_of_a_street_is_empty() -> None:
    names = column("name", street(name_field="name"), name=["Rue É", None, " "])
    assert names == ["Rue É", "", ""]


def test_portal_fields_may_have_other_spellings(read_as: Callable[..., RawLayer]) -> None:
    text = (
        'Largeur (m);TYPE VOIE;geo_shape\n;Rue;"{""type"": ""LineString"", '
        '""coordinates"": [[2.3, 48.8], [2.4, 48.8]]}"\n'
    )
    by = WidthBy("type_voie", (("Rue", 13.0),))
    spec = street(geometry="line", width_field="largeur_m", width_by=by)
    layer = read_as("voies.csv", text, spec)
    assert layer.table["half_width"].tolist() == [6.5]
