from __future__ import annotations

import csv
import io

from stiffdice.report.markdown_table import rendered

ROWS = [["a", 1, "x, y"], ['say "so"', 2.5, "p | q"]]


def test_the_csv_says_what_the_rows_say():
    table = rendered("Title", ["name", "value [1]", "note"], ROWS)
    assert list(csv.reader(io.StringIO(table.csv))) == [
        ["name", "value [1]", "note"],
        *([str(part) for part in row] for row in ROWS),
    ]


def test_the_markdown_has_a_line_for_each_row_and_keeps_its_columns():
    lines = rendered("Title", ["name", "value [1]", "note"], ROWS, "A note.").markdown.splitlines()
    assert lines[0] == "# Title"
    assert lines[2:4] == ["| name | value [1] | note |", "| --- | --- | --- |"]
    assert lines[4] == "| a | 1 | x, y |"
    assert lines[5].replace("\\|", "").count("|") == 4
    assert lines[-1] == "A note."
