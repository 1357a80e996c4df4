"""How many time steps does a stiff ground cost, and what do you get for them?"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from os import PathLike

    import xarray

__version__ = "0.1.0"


def open_results(path: str | PathLike[str]) -> xarray.Dataset:
    """Return the dataset in a file of stiffdice, loaded, with enums as words: `sel(contact="gated")`, `sel(axis="z")`.

    `xarray.open_dataset` opens the same file with the enums as the numbers that are stored. Raises
    stiffdice.errors.InputError, naming the file, if it cannot be read or trusted (docs/trust.md).
    """
    # These take about a second to import; the package itself takes none.
    from stiffdice.io import quarantine
    from stiffdice.io.labels import labelled
    from stiffdice.io.read import open_file

    name = str(path)
    quarantine.admit(name)
    return labelled(open_file(name))
