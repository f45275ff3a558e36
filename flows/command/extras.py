"""Libraries that belong to an extra of the installation: name the extra when one of them is missing."""

from __future__ import annotations

#: Extra that brings a library, by the name under which it is imported.
EXTRA_OF = {
    "prefect": "server",
    "fastapi": "server",
    "cronsim": "server",
    "apprise": "server",
    "dash": "server",
    "dash_ag_grid": "server",
    "plotly": "server",
    "waitress": "server",
    "prometheus_client": "server",
    "distributed": "cluster",
    "dask": "cluster",
    "pg8000": "postgresql",
    "rasterio": "images",
}


def missing_extra(error: ImportError) -> str | None:
    """A sentence that says what to install for a missing library; None if it belongs to no extra."""
    library = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(library)
    if extra is None:
        return None
    return (
        f"This command needs {library}, which is not installed. "
        f"Install aerocal with its extra: pip install 'aerocal[{extra}]'."
    )
