"""Of pytest: import one module of stiffdice as one of its mutants. No file is changed."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from hypothesis import Phase, settings

from tests.mutation.mutants import mutant

# The same examples each time; nobody reads the smallest one that fails.
settings.register_profile(
    "mutants", deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate)
)


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: str, index: int) -> None:
        super().__init__(name, path)
        self.index = index

    def get_code(self, fullname: str) -> CodeType:
        tree = mutant(Path(self.path).read_text(encoding="utf-8"), self.index).tree
        return compile(tree, self.path, "exec", dont_inherit=True)


class _Finder(PathFinder):
    name, index = "", 0

    @classmethod
    def find_spec(
        cls, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != cls.name:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        assert spec is not None
        assert spec.origin is not None
        spec.loader = _Loader(fullname, spec.origin, cls.index)
        return spec


if asked := os.environ.get("STIFFDICE_MUTANT"):
    _Finder.name, _, number = asked.partition(":")
    _Finder.index = int(number)
    sys.meta_path.insert(0, _Finder)  # type: ignore[arg-type]
