"""The schema of a database, as far as it shows from outside."""

from typing import Any

from sqlalchemy import Connection, inspect

__all__ = ["schema_of"]


def schema_of(connection: Connection, *tables: str) -> dict[str, Any]:
    """Return columns, keys and indexes of tables, in a form that can be compared."""
    seen = inspect(connection)
    return {
        name: {
            "columns": [
                (one["name"], str(one["type"]), one["nullable"], one["default"])
                for one in seen.get_columns(name)
            ],
            "primary key": seen.get_pk_constraint(name)["constrained_columns"],
            "foreign keys": [
                (one["constrained_columns"], one["referred_table"], one["options"])
                for one in seen.get_foreign_keys(name)
            ],
            "indexes": sorted(
                (str(one["name"]), one["column_names"]) for one in seen.get_indexes(name)
            ),
        }
        for name in tables
    }
