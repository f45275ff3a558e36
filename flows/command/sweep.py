"""``aerocal sweep``: scenarios of one project side by side."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.options import Dask, Data, Json, Out, Overrides, ProjectFile, Server


def sweep(
    project: ProjectFile,
    out: Out = None,
    overrides: Overrides = None,
    data: Data = None,
    server: Server = None,
    dask: Dask = None,
    json: Json = False,
) -> None:
    """Adjust every scenario of a project's sweep: one table, one page.

    A scenario is a sub-block, a choice of control points and a variant of the settings. Shared parts are
    computed once; an interrupted sweep resumes where it stopped.

    Results: sweep.parquet, sweep.html. A scenario that cannot be computed is a row with the reason.

    [bold]Examples[/bold]

      aerocal simulate uce-testfield --out field && aerocal sweep field/project.toml

      aerocal sweep project.toml --set sweep.workers=4

      aerocal sweep project.toml --set 'sweep.parameters=["none", "bluh:1-12"]'

      aerocal sweep project.toml --dask tcp://HOST:8786

    [bold]Exit codes[/bold]  0 done · 2 wrong input · 3 no scenario computable
    """
    from flows.command.sweep_execution import execute_sweep

    end_with(lambda: execute_sweep(project, out, tuple(overrides or ()), data, server, dask, as_json=json))
