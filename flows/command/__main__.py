"""The program ``aerocal``, also as ``python -m flows.command``."""

from __future__ import annotations

from flows.command.interruption import end_on_signals


def main() -> None:
    """Run the command line; ends the process with the exit code of the contract."""
    end_on_signals(_command_line)


def _command_line() -> None:
    from flows.command.main import app

    app()


if __name__ == "__main__":
    main()
