"""Section: what the study was made from, with which software, where and when."""

import json

from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section

MACHINE = {
    "node": "Node",
    "system": "System",
    "processor": "Processor",
    "cores": "Cores",
    "python": "Python",
    "slurm_job": "Slurm job",
    "plans": "FFT plans",
}


def provenance(data: ReportData) -> Section:
    """Spec, versions, machine, date, commit."""
    attributes, machine = data.attributes, data.json("machine")
    software = [attributes.get(name, "") for name in ("software", "software_version")]
    facts = [
        ("Study", data.name),
        ("Written", attributes.get("date", "")),
        ("Software", " ".join(software).strip()),
        ("Git commit", attributes.get("git_commit", "")),
        *((title, str(machine.get(key, ""))) for key, title in MACHINE.items()),
        *data.json("packages").items(),
    ]
    content = {
        "spec_text": attributes.get("spec_text", ""),
        "resolved": json.dumps(data.json("spec"), indent=1),
        "facts": facts,
    }
    return Section("Provenance", template="provenance.html", content=content)
