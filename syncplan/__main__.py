"""`python -m syncplan` is the command line."""

from syncplan.cli.command_line import main

if __name__ == "__main__":
    main()
