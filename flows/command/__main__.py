"""``python -m flows.command``: the command line without the installed script."""

from flows.command.main import main

main()
