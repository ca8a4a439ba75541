#!/usr/bin/env python3
"""Writes docs/stymo.spdx.json from the table in docs/dependencies.md and the installed versions."""
import argparse
import json
import pathlib
import re
import subprocess

root = pathlib.Path(__file__).resolve().parent.parent
row = re.compile(r"^\| `(?P<name>[^`]+)` \| (?P<licence>[^|]+?) \| (?P<needed>[^|]+?) \|")


def version_of(package: str) -> str:
    query = ["dpkg-query", "--show", "--showformat=${Version}", package]
    return subprocess.run(query, check=True, capture_output=True, text=True).stdout


def spdx_id(name: str) -> str:
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", name)


def package(name: str, version: str, licence: str) -> dict:
    return {
        "SPDXID": spdx_id(name),
        "name": name,
        "versionInfo": version,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "licenseConcluded": "NOASSERTION",
        "licenseDeclared": licence,
        "copyrightText": "NOASSERTION",
    }


def relation(needed: str, name: str) -> dict:
    if needed == "tests":
        kind, ends = "TEST_DEPENDENCY_OF", (spdx_id(name), spdx_id("stymo"))
    elif needed.startswith("optional"):
        kind, ends = "OPTIONAL_DEPENDENCY_OF", (spdx_id(name), spdx_id("stymo"))
    else:
        kind, ends = "DEPENDS_ON", (spdx_id("stymo"), spdx_id(name))
    return {"spdxElementId": ends[0], "relationshipType": kind, "relatedSpdxElement": ends[1]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=pathlib.Path, default=root / "docs/stymo.spdx.json")
    o = parser.parse_args()
    project = (root / "CMakeLists.txt").read_text()
    version = re.search(r"project\(stymo VERSION ([0-9.]+)", project).group(1)
    table = (root / "docs/dependencies.md").read_text().splitlines()
    rows = [match for match in map(row.match, table) if match]
    document = {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"stymo-{version}",
        "documentNamespace": f"urn:stymo:spdx:{version}",
        "creationInfo": {"creators": ["Tool: scripts/write_spdx.py"],
                         "created": "2026-11-23T00:00:00Z"},
        "documentDescribes": [spdx_id("stymo")],
        "packages": [package("stymo", version, "MIT")] +
                    [package(r["name"], version_of(r["name"]), r["licence"]) for r in rows],
        "relationships": [relation(r["needed"], r["name"]) for r in rows],
    }
    o.file.write_text(json.dumps(document, indent=1) + "\n")


main()
