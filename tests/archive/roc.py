"""The RO-Crate validator, without a network."""

from __future__ import annotations

import io
import json
import warnings
from pathlib import Path

from requests.adapters import HTTPAdapter
from urllib3 import HTTPResponse

# The terms of RO-Crate 1.1's context that our crates use, as https://w3id.org/ro/crate/1.1/context defines them. A term
# that is not among them is told by the validator as one that the context does not have.
CONTEXT = "https://w3id.org/ro/crate/1.1/context"
_SCHEMA_ORG = """
    CreateAction CreativeWork ComputerLanguage Dataset Organization Person
    SoftwareApplication SoftwareSourceCode WebSite
    about actionStatus affiliation agent author citation contentSize datePublished description
    encodingFormat endTime hasPart identifier instrument keywords license mainEntity mentions name
    object programmingLanguage result softwareRequirements softwareVersion startTime url
    version
"""
TERMS = {term: f"http://schema.org/{term}" for term in _SCHEMA_ORG.split()} | {
    "File": "http://schema.org/MediaObject",
    "ComputationalWorkflow": "https://bioschemas.org/ComputationalWorkflow",
    "conformsTo": "http://purl.org/dc/terms/conformsTo",
}


class _Shelf(HTTPAdapter):
    """Gives the context to whoever asks, whatever for."""

    def send(self, request, **_):
        body = io.BytesIO(json.dumps({"@context": TERMS}).encode())
        headers = {"Content-Type": "application/ld+json"}
        raw = HTTPResponse(body, headers, status=200, preload_content=False, request_url=request.url)
        return self.build_response(request, raw)


def findings(crate: Path, profile: str, folder: Path) -> dict[str, set[str]]:
    """Return what the validator has to say of a crate: messages by severity, required or recommended."""
    from requests_cache import CachedSession
    from rocrate_validator.models import Severity, ValidationSettings
    from rocrate_validator.services import validate

    with CachedSession(str(folder / "http"), backend="sqlite", expire_after=-1) as session:
        session.mount("https://", _Shelf())
        session.get(CONTEXT)
    settings = ValidationSettings(
        rocrate_uri=crate,
        profile_identifier=profile,
        requirement_severity=Severity.RECOMMENDED,
        cache_path=folder / "http",
        offline=True,
    )
    told: dict[str, set[str]] = {"REQUIRED": set(), "RECOMMENDED": set()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of rdflib, about its own classes
        issues = validate(settings).get_issues()
    for issue in issues:
        told[issue.severity.name].add(f"{issue.violatingEntity}: {issue.message}")
    return told
