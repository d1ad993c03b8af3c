"""Arguments that searches with random draws share."""

import argparse

__all__ = ["search_arguments"]


def search_arguments(
    description: str | None, draws: int, *, trials: bool = True
) -> argparse.ArgumentParser:
    """Return a parser of [DRAWS [SEED]] [--trials N] [--processes N].

    Options that are not given are left out: their defaults are those of the search's `main`.
    """
    parser = argparse.ArgumentParser(description=description, argument_default=argparse.SUPPRESS)
    parser.add_argument("draws", nargs="?", type=int, default=draws)
    parser.add_argument("seed", nargs="?", type=int, default=0)
    if trials:
        parser.add_argument("--trials", type=int)
    parser.add_argument("--processes", type=int)
    return parser
