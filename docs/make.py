"""Write the pages that follow from the code: `make docs`."""

from __future__ import annotations

from docs import make_api, make_cli, make_config, make_format, make_index
from docs.markdown import DOCS


def pages() -> dict[str, str]:
    """Return the texts of all pages that are written by code, in whole or in part, by their path in docs/."""
    written = make_api.pages() | make_cli.pages() | make_config.pages() | make_format.pages()
    return written | make_index.pages(written)


if __name__ == "__main__":
    for path, text in pages().items():
        (DOCS / path).parent.mkdir(parents=True, exist_ok=True)
        (DOCS / path).write_text(text, encoding="utf-8")
