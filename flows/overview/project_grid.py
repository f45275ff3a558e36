"""The grid of projects and stages: its columns, and a row as the browser gets it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from zoneinfo import ZoneInfo

import dash_ag_grid as dag

from tasks.production.board import ProjectRow
from tasks.production.stages import STAGES, StageRow, stages_of

GRID = "projects"
#: Stories as the grid calls them.
STORY_LABELS: Mapping[str, str] = {
    "aerial-triangulation": "triangulation",
    "system-calibration": "calibration",
    "direct-georeferencing-check": "direct check",
    "scenario-sweep": "sweep",
    "image-quality": "image quality",
}
Column = dict[str, Any]
_TRUSTED = {"plan": "in plan", "height": "in height"}
_THEME = (
    "themeQuartz.withParams({fontFamily: 'system-ui, DejaVu Sans, sans-serif', "
    "fontSize: 13, headerFontSize: 12, "
    "foregroundColor: '#1f2933', headerTextColor: '#38444f', headerBackgroundColor: '#f1f4f7', "
    "borderColor: '#d9dfe5', oddRowBackgroundColor: '#fafbfc', accentColor: '#0072B2', spacing: 5, "
    "cellHorizontalPadding: 8, wrapperBorderRadius: 4})"
)


def project_grid(rows: Sequence[ProjectRow], dashboard: str, zone: ZoneInfo) -> dag.AgGrid:
    """The grid.

    Parameters
    ----------
    dashboard : address of the server's own pages.
    zone : the time zone of its times.
    """
    return dag.AgGrid(
        id=GRID,
        className="ag-theme-overview",
        columnDefs=columns(rows, dashboard),
        rowData=[row_data(row, zone) for row in rows],
        getRowId="params.data.key",
        defaultColDef={
            "sortable": True,
            "filter": True,
            "resizable": True,
            "suppressHeaderMenuButton": True,
            "suppressMovable": True,
        },
        dashGridOptions={
            "theme": {"function": _THEME},
            "rowHeight": 30,
            "headerHeight": 92,
            "animateRows": False,
            "tooltipShowDelay": 250,
            "rowSelection": {"mode": "singleRow", "checkboxes": False, "enableClickSelection": True},
            "enableCellTextSelection": True,
            "suppressColumnVirtualisation": True,
        },
        dangerously_allow_code=False,
        style={"height": None, "width": "100%"},
    )


def columns_for(rows: Sequence[ProjectRow]) -> tuple[str, ...]:
    """Columns that not every project needs, of those which these do: stages, and figures of trust maps."""
    stages = {stage for row in rows for stage in (*stages_of(row.run.story), *row.stages)}
    figures = {
        f"trust_{name}"
        for name in _TRUSTED
        if any(getattr(row.run.figures, f"trust_map_{name}_m") is not None for row in rows)
    }
    return (*(stage for stage in STAGES if stage in stages), *sorted(figures))


def columns(rows: Sequence[ProjectRow], dashboard: str) -> list[Column]:
    """The columns; those that no project needs are hidden."""
    used = columns_for(rows)
    return [
        {"field": "project", "headerName": "Project", "pinned": "left", "width": 164, "tooltipField": "file",
         "cellClass": "project"},
        {"field": "state", "headerName": "State", "pinned": "left", "width": 126,
         "cellRenderer": "StateCell", "tooltipField": "message", "cellClass": "state",
         "filterParams": {"maxNumConditions": 8}},
        {"headerName": "Results", "colId": "links", "width": 196, "sortable": False, "filter": False,
         "cellRenderer": "LinksCell", "cellRendererParams": {"dashboard": dashboard}},
        {"field": "story", "headerName": "Story", "width": 104},
        *(_stage_column(stage, stage.name in used) for stage in STAGES.values()),
        {"field": "changed", "headerName": "Age", "width": 64, "sort": "desc", "type": "rightAligned",
         "valueFormatter": {"function": "age(params.value)"}, "tooltipField": "changed", "filter": False},
        _figure("sigma0", "σ0", "σ0 a posteriori / a priori", 58),
        _figure("rmse_x", "RMSE x [m]", "RMSE of the check points, x [m]", 62),
        _figure("rmse_y", "RMSE y [m]", "RMSE of the check points, y [m]", 62),
        _figure("rmse_z", "RMSE z [m]", "RMSE of the check points, z [m]", 62),
        *(
            _figure(f"trust_{name}", f"σ new {name} [m]", f"Trust map: σ of new points {words}", 70)
            | {"hide": f"trust_{name}" not in used}
            for name, words in _TRUSTED.items()
        ),
        {"field": "gates", "headerName": "Gates passed", "width": 148, "cellRenderer": "GatesCell",
         "tooltipField": "gates", "comparator": {"function": "byGates"}},
        {"field": "problem", "headerName": "First problem", "minWidth": 260, "flex": 1,
         "tooltipField": "problem", "cellClass": "problem"},
        {"field": "seconds", "headerName": "Duration", "width": 78, "type": "rightAligned",
         "filter": "agNumberColumnFilter", "valueFormatter": {"function": "duration(params)"}},
        {"field": "runs", "headerName": "Runs", "width": 58, "type": "rightAligned",
         "filter": "agNumberColumnFilter"},
    ]  # fmt: skip


def _stage_column(stage: StageRow, used: bool) -> Column:
    return {
        "field": f"stages.{stage.name}",
        "colId": stage.name,
        "headerName": stage.label,
        "headerTooltip": f"Stage {stage.name}",
        "headerClass": "stage-head",
        "cellClass": "stage",
        "width": 25,
        "minWidth": 25,
        "resizable": False,
        "hide": not used,
        "cellRenderer": "StageCell",
        "cellRendererParams": {"stage": stage.label},
        "floatingFilter": False,
    }


def _figure(field: str, label: str, told: str, width: int) -> Column:
    return {
        "field": field,
        "headerName": label,
        "headerTooltip": told,
        "width": width,
        "type": "rightAligned",
        "filter": "agNumberColumnFilter",
        "valueFormatter": {"function": "fixed(params.value, 3)"},
        "cellClassRules": {"beyond": {"function": f"beyond(params, '{field}')"}},
    }


#: Gates by the column whose figure they limit.
_GATE_OF_COLUMN = {
    "sigma0": "sigma0",
    **{f"rmse_{axis}": f"rmse_check_m_{axis}" for axis in "xyz"},
    **{f"trust_{name}": f"trust_map_{name}_m" for name in _TRUSTED},
}


def row_data(row: ProjectRow, zone: ZoneInfo) -> dict[str, Any]:
    """A row as the browser gets it: plain values, times as ISO 8601 in `zone`, no missing values."""
    run, figures, failed = row.run, row.run.figures, row.failed_gates
    passed = len(figures.gates) - len(failed)
    x, y, z = figures.rmse_check_m
    values = {
        "key": row.key,
        "run": run.id,
        "project": run.project,
        "file": run.project_file or None,
        "story": STORY_LABELS.get(run.story, run.story),
        "state": run.state,
        "message": run.message or None,
        "stages": dict(row.stages),
        "changed": row.changed.astimezone(zone).isoformat(timespec="seconds"),
        "begun": run.begun.isoformat(timespec="seconds") if run.begun and run.ended is None else None,
        "seconds": None if row.seconds is None else round(row.seconds, 1),
        "sigma0": figures.sigma0,
        "rmse_x": x,
        "rmse_y": y,
        "rmse_z": z,
        "trust_plan": figures.trust_map_plan_m,
        "trust_height": figures.trust_map_height_m,
        "gates": f"{passed} of {len(figures.gates)}" + (f": {', '.join(failed)}" if failed else "")
        if figures.gates
        else None,
        "beyond": [column for column, gate in _GATE_OF_COLUMN.items() if gate in failed] or None,
        "problem": row.problem,
        "runs": row.runs,
        "documents": list(row.documents) or None,
    }
    return {name: value for name, value in values.items() if value is not None}
