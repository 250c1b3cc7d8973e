"""What the study was made from, with what, where and when."""

import json
from typing import Any

from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.markup import Html, details, join, tag

MACHINE = {
    "node": "Node",
    "system": "System",
    "processor": "Processor",
    "cores": "Cores",
    "python": "Python",
    "slurm_job": "Slurm job",
    "plans": "Plans of transforms",
}


def origin(contents: Contents) -> Section | None:
    """Spec, versions, machine, date, commit."""
    attributes, machine = contents.attributes, contents.data("machine")
    pairs = [
        ("Study", contents.name),
        ("Written", attributes.get("date", "")),
        ("Software", _software(attributes)),
        ("Git commit", attributes.get("git_commit", "")),
        *((title, str(machine.get(key, ""))) for key, title in MACHINE.items()),
        *contents.data("packages").items(),
    ]
    described = tag(
        "dl",
        *(tag("div", tag("dt", name), tag("dd", value)) for name, value in pairs if value),
        class_="facts",
    )
    body = join(
        tag("h3", "Spec as given"),
        _text(attributes.get("spec_text", "")),
        details("Resolved spec: every default filled in", _text(_pretty(contents.data("spec")))),
        tag("h3", "Software and machine"),
        described,
    )
    return Section("Origin", body)


def _software(attributes: dict[str, str]) -> str:
    return f"{attributes.get('software', '')} {attributes.get('software_version', '')}".strip()


def _pretty(spec: dict[str, Any]) -> str:
    return json.dumps(spec, indent=1)


def _text(content: str) -> Html:
    return tag("pre", tag("code", content), tabindex=0, role="group", aria_label="Text")
