from __future__ import annotations

from semsig_gis.tables import Table, escaped, percent


def test_a_table_is_markdown() -> None:
    table = Table("A|B", ("What", "m"), (("a|b", "<1"), ("x", "")), note="see\n|")
    assert table.markdown() == (
        "### A\\|B\n\n| What | m |\n| --- | ---: |\n| a\\|b | &lt;1 |\n| x |  |\n\nsee \\|\n"
    )


def test_text_from_data_breaks_nothing() -> None:
    assert escaped(" a\n& b ") == "a &amp; b"
    assert percent(1.0) == "100.0 %"
