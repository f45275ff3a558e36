"""``python -m flows.command``: the command line without the installed script."""

from flows.command.main import main

if __name__ == "__main__":
    main()
