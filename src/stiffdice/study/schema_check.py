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
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.simulation import backend
from stiffdice.simulation.engines import registry as engines


def check(data: object, schema: str | Path, source: str) -> None:
    """Raise InputError unless a study's data are as the JSON schema in a file says; source: the study's file.

    The names of models, schemes, simulators and contact laws, which that file leaves open, are those of the code.
    """
    import jsonschema  # which takes a while to import

    numbers = jsonschema.Draft202012Validator.TYPE_CHECKER.redefine("number", _is_number)
    kind = jsonschema.validators.extend(jsonschema.Draft202012Validator, type_checker=numbers)  # type: ignore[no-untyped-call]
    error = jsonschema.exceptions.best_match(kind(_filled(yaml_loader.load(schema))).iter_errors(data))
    if error is not None:
        raise InputError(f"{source}: {_reason(error)}")


def _is_number(_checker: object, value: object) -> bool:
    """Return whether a value is a number; NaN is none: no bound of a schema stops it."""
    return not isinstance(value, bool) and (
        isinstance(value, int) or (isinstance(value, float) and not math.isnan(value))
    )


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
