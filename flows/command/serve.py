"""``aerocal serve``: server, dashboard, deployments and runner in one."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.serve_options import (
    CronOption,
    DatabaseOption,
    HistoryDaysOption,
    HostOption,
    InboxOption,
    KeepDaysOption,
    LimitOption,
    NotifyOnOption,
    OnlyOnScheduleOption,
    OverviewPortOption,
    PortOption,
    PublicOverviewUrlOption,
    PublicUrlOption,
    RecalibrationCronOption,
    RegistryOption,
    ResultsOption,
    RootsOption,
    StateOption,
    StoryOption,
    TimezoneOption,
    WatchOption,
)
from flows.command.server_log import LogFormatOption, said_as


def serve(
    host: HostOption = "127.0.0.1",
    port: PortOption = 4200,
    public_url: PublicUrlOption = None,
    public_overview_url: PublicOverviewUrlOption = None,
    overview_port: OverviewPortOption = None,
    database: DatabaseOption = None,
    root: RootsOption = None,
    inbox: InboxOption = None,
    story: StoryOption = "aerial-triangulation",
    watch: WatchOption = 20.0,
    cron: CronOption = None,
    only_on_schedule: OnlyOnScheduleOption = False,
    timezone: TimezoneOption = "UTC",
    registry: RegistryOption = None,
    recalibration_cron: RecalibrationCronOption = None,
    keep_days: KeepDaysOption = None,
    history_days: HistoryDaysOption = 365,
    results: ResultsOption = None,
    limit: LimitOption = 1,
    notify_on: NotifyOnOption = "gate,failure,recalibration",
    state: StateOption = None,
    log_format: LogFormatOption = "text",
) -> None:
    """Run the server: dashboard, deployments, and a runner that executes them.

    While it is running, [bold]aerocal run[/bold] and similar commands appear in the dashboard. After SIGTERM
    or Ctrl+C, it finishes current runs and stops; a second signal stops the runs as well.

    [bold]Examples[/bold]

      aerocal serve --root /data/projects

      aerocal serve --root /data --inbox /data/inbox --cron "30 1 * * *" --timezone Europe/Berlin

    [bold]Exit codes[/bold]  0 stopped as requested · 2 an option is wrong · 1 it cannot start, or failed
    """
    given = dict(locals())
    say = said_as(given.pop("log_format"))

    def carry_out() -> int:
        from flows.server.settings import settings_of
        from flows.serving.serve import serve as run_server

        return run_server(settings_of(given), say)

    end_with(carry_out)
