"""Options of an import: patterns of names, by what the features become that match them."""

from dataclasses import dataclass

from syncplan.options import RunOptions, option


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions(RunOptions):
    """Patterns of names of features or of their folders, such as `no fly*`."""

    area: tuple[str, ...] = option((), "Name of the area's polygon; of several, the largest counts")
    keep_out: tuple[str, ...] = option((), "Names of polygons that paths avoid, as 'no fly*'")
    obstacle: tuple[str, ...] = option((), "Names of polygons that block sight")
    landmark: tuple[str, ...] = option((), "Names of points that are known and sighted")
    left_out: tuple[str, ...] = option((), "Names of features that are left out")
