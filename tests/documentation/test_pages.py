"""How commands are found on a page."""

from __future__ import annotations

from tests.documentation.checkout import parts
from tests.documentation.pages import blocks, commands, lines

PAGE = """\
<!-- needs: mujoco -->

<!-- exit status: 1 -->

```sh
one --option
```

```text
printed
```

Prose.

<!-- not run (two): it takes
hours -->

```console
$ one
first
$ two
```

```text
no output of a command
```

<!-- not run from here: signatures -->

## Heading

```python
three()
```

```sh
four
```
"""


def test_blocks_have_their_marks_and_what_they_print():
    first, second, third, fourth = blocks("a page", PAGE)
    assert (first.needs, first.status, first.steps) == ("mujoco", 1, [("one --option\n", "printed\n")])
    assert (second.left_out, second.not_run) == (("two",), "")
    assert second.steps == [("one\n", "first\n"), ("two\n", None)]
    assert third.not_run == fourth.not_run == "signatures"
    assert first.line == 5


def test_a_line_is_split_into_simple_commands():
    script = (
        "# before\nA=b .venv/bin/stiffdice run 'a b.yaml' \\\n  -o out.h5 | head > file  # told\ncat <<END\nx y\nEND\n"
    )
    words = [[*commands(line)] for line in lines(script)]
    assert words == [[["stiffdice", "run", "a b.yaml", "-o", "out.h5"], ["head"]], [["cat"]]]


def test_what_needs_a_shell_is_one_part_and_plain_lines_about_it_are_one_each():
    held = "cat > a.yaml <<END\n  # kept\nstiffdice here\nEND"
    after = ".venv/bin/stiffdice run a.yaml \\\n-o a.h5\n# after\nstiffdice inspect a.h5\n"
    run, look = ".venv/bin/stiffdice run a.yaml  -o a.h5", "stiffdice inspect a.h5"
    assert parts(f"stiffdice new a  # told\n\n{held}\n{after}") == ["stiffdice new a", held, run, look]
    assert parts("stiffdice inspect a.h5 | head\n") == ["stiffdice inspect a.h5 | head"]
