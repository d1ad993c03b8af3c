"""Constraints on one vehicle or one pair each, all at once, with their sparse Jacobian.

The function of one block is differentiated once and mapped over all blocks; its derivatives by the
block's own circles are then put in their places. Colouring the whole Jacobian instead would take a
sweep over all constraints for each variable of the vehicle with the most neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index


@dataclass(frozen=True, slots=True)
class Blocks:
    """Constraints on circles (4, n), each bounded from below.

    Attributes
    ----------
    values : (g,)
    jacobian : (g, 4 n) sparse, by the circles column by column
    lower : (g,) what the values must reach
    labels : (g,) what each is
    """

    values: ca.MX
    jacobian: ca.MX
    lower: Array
    labels: tuple[str, ...]


def pair_blocks(
    function: ca.Function,
    circles: ca.MX,
    pairs: Index,
    parameters: Sequence[ca.DM | ca.MX],
    lower: Array,
    labels: list[str],
) -> Blocks:
    """Return the blocks of a function (a, b, ...) -> scalar for (e, 2) pairs of circles (4, n)."""
    inputs = [circles[:, pairs[:, 0].tolist()], circles[:, pairs[:, 1].tolist()], *parameters]
    return _blocks(function, inputs, [pairs[:, 0], pairs[:, 1]], circles.size2(), lower, labels)


def single_blocks(
    function: ca.Function,
    circles: ca.MX,
    vehicles: Index,
    parameters: Sequence[ca.DM | ca.MX],
    lower: Array,
    labels: list[str],
) -> Blocks:
    """Return the blocks of a function (a, ...) -> scalar for (e,) vehicles of circles (4, n)."""
    inputs = [circles[:, vehicles.tolist()], *parameters]
    return _blocks(function, inputs, [vehicles], circles.size2(), lower, labels)


def stacked_blocks(blocks: list[Blocks], count: int) -> Blocks:
    """Return blocks on `count` vehicles, one below the other; without any, (0,) values."""
    return Blocks(
        ca.vertcat(ca.MX(0, 1), *(block.values for block in blocks)),
        ca.vertcat(ca.MX(0, 4 * count), *(block.jacobian for block in blocks)),
        np.concatenate([np.zeros(0), *(block.lower for block in blocks)]),
        tuple(label for block in blocks for label in block.labels),
    )


def _blocks(
    function: ca.Function,
    inputs: Sequence[ca.DM | ca.MX],
    owners: list[Index],
    count: int,
    lower: Array,
    labels: list[str],
) -> Blocks:
    number = len(owners[0])
    values = function.map(number)(*inputs)
    output = function.name_out(0)
    names = [f"jac:{output}:{function.name_in(k)}" for k in range(len(owners))]
    derivative = function.factory(f"{function.name()}_jacobian", function.name_in(), names)
    found = derivative.map(number)(*inputs)
    parts = [ca.vec(part) for part in (found if isinstance(found, tuple | list) else [found])]
    row = np.tile(np.repeat(np.arange(number), 4), len(owners))
    column = np.concatenate([(4 * owner[:, None] + np.arange(4)).ravel() for owner in owners])
    order = np.lexsort((row, column))
    sparsity = ca.Sparsity.triplet(number, 4 * count, row.tolist(), column.tolist())
    entries = ca.vertcat(*(ca.densify(part) for part in parts))
    return Blocks(ca.vec(values), ca.MX(sparsity, entries[order.tolist()]), lower, tuple(labels))
