"""Command line, run as `python -m syncplan`."""

from syncplan.cli.command_line import main

if __name__ == "__main__":
    main()
