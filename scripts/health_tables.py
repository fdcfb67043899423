"""Updates the tables of docs/health.md: .venv/bin/python scripts/health_tables.py

The tables of settings and metrics come from the code. A test checks that the page is up to date.
"""

from __future__ import annotations

import re
from pathlib import Path

from settings_page import make_tables

from enliven.health_page.metrics import metrics_table
from enliven.kiosk.profile import AlertSettings, HealthPageSettings

PAGE = Path(__file__).parents[1] / "docs" / "health.md"


def make_page(page: str) -> str:
    """Returns the page with everything between its marks regenerated."""
    contents = {
        "health": "\n".join(make_tables(HealthPageSettings, "health")),
        "alerts": "\n".join(make_tables(AlertSettings, "alerts")),
        "metrics": metrics_table(),
    }

    def regenerate(match: re.Match[str]) -> str:
        return f"<!-- table {match[1]} -->\n\n{contents[match[1]]}\n\n<!-- end -->"

    return re.sub(r"<!-- table (\w+) -->.*?<!-- end -->", regenerate, page, flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(make_page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
