"""Data that goes into the script of a page."""

from __future__ import annotations

import json
import re
from importlib import resources

import pytest
from folium.template import Template
from hypothesis import example, given
from hypothesis import strategies as st

from semsig_gis.maps.image import script_json
from semsig_gis.maps.parts import page_element

BROWSER_FILES = sorted(
    one.name for one in resources.files("semsig_gis.maps").joinpath("js").iterdir()
)
nasty = st.text(st.sampled_from(list("{}%#<>&'\"`$\\/-! 7*é\u2028\ud7ff")), max_size=12)
values = st.recursive(
    st.none() | st.integers() | st.text() | nasty,
    lambda children: st.lists(children, max_size=4) | st.dictionaries(nasty, children, max_size=4),
    max_leaves=12,
)


@given(values)
@example("{{7*7}}")
@example("{{ this._parent }}{% raw %}{# gone #}")
@example({"{": {"{{": "{%"}, "": {}})
@example("</script><!--<script>")
def test_two_renderings_leave_the_value_as_it_was(value: object) -> None:
    written = script_json(value)
    once = Template(written).render()
    assert json.loads(Template(once).render()) == value


@given(values)
def test_nothing_in_it_is_markup(value: object) -> None:
    written = script_json(value)
    assert written.isascii()
    assert not re.search(r"[<>&]|\{[{%#]", written)


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_numbers_that_json_does_not_have_are_refused(number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_json([number])


@pytest.mark.parametrize("file", BROWSER_FILES)
def test_style_and_script_are_no_templates_themselves(file: str) -> None:
    element = page_element(file)
    assert Template(element).render() == element
    assert element.count("</") == 1
