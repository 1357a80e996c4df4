"""Whether a study's YAML file has the form that its JSON schema asks for; what is wrong, in one line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from stiffdice.dynamics import model_selection
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.io import yaml_loader
from stiffdice.scene import validation
from stiffdice.scene.ground import CONTACT_LAWS
from stiffdice.simulation import backend
from stiffdice.simulation.engines import registry as engines

# A misspelt key is told before the key that it leaves missing.
_RANK = {"additionalProperties": 0, "required": 2, "oneOf": 3}


def check(data: object, schema: str | Path, source: str) -> None:
    """Raise InputError unless a study's data are as the JSON schema in a file says; source: the study's file.

    The names of models, schemes, simulators and contact laws, which that file leaves open, are those of the code.
    """
    import jsonschema  # which takes a while to import

    _refuse_nan(data, "", source)
    validator = jsonschema.Draft202012Validator(_filled(yaml_loader.load(schema)))
    errors = sorted(validator.iter_errors(data), key=_rank)
    if errors:
        raise InputError(f"{source}: {_reason(_innermost(errors[0]))}")


def _filled(schema: Any) -> Any:
    """Return a study's schema with the names that its file leaves to the code."""
    known = {
        "model": model_selection.CHOICES,
        "scheme": schemes.SCHEMES,
        "simulator": (backend.OURS, *engines.ENGINES),
        "contact_law": CONTACT_LAWS,
    }
    for kind, names in known.items():
        schema["$defs"][kind] = {"enum": list(names), "errorMessage": f"allowed is {' or '.join(names)}"}
    return schema


def _refuse_nan(data: object, where: str, source: str) -> None:
    """Raise InputError if a number is not one: no bound of a schema stops a NaN."""
    if isinstance(data, float) and math.isnan(data):
        raise InputError(f"{source}: {where[1:]} = nan: allowed is a finite number")
    parts = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, part in parts:
        _refuse_nan(part, f"{where}.{key}", source)


def _rank(error: Any) -> int:
    return _RANK.get(str(error.validator), 1)


def _innermost(error: Any) -> Any:
    """Return what is wrong within a value that may be of several kinds, if it is of one of them."""
    if error.validator != "anyOf":
        return error
    others = {part.relative_schema_path[0] for part in error.context if part.validator == "type" and not part.path}
    for part in sorted(error.context, key=_rank):
        inner = _innermost(part)
        if part.relative_schema_path[0] not in others and inner.validator != "anyOf":
            return inner
    return error


def _reason(error: Any) -> str:
    """Return a schema error as one line that names the key, its value and what is allowed."""
    where = ".".join(str(part) for part in error.absolute_path)
    try:
        if error.validator == "additionalProperties":
            validation.known_keys(where, error.instance, list(error.schema["properties"]))
    except InputError as unknown:
        return str(unknown)
    if error.validator == "required":
        missing = [key for key in error.validator_value if key not in error.instance]
        return f"{where + '.' if where else ''}{missing[0]} is missing"
    allowed = error.schema.get("errorMessage")
    if error.validator == "enum" and allowed:
        allowed += validation.meant(error.instance, error.validator_value)
    if error.validator == "oneOf":
        return f"{where}: {allowed}"
    if "propertyNames" in error.absolute_schema_path:
        return f"{where}.{error.instance}: allowed names have small letters, digits and hyphens"
    return f"{where or 'the file'} = {validation.shown(error.instance)}: {allowed or error.message}"
