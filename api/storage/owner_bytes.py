"""Bytes that each owner keeps, by kind: plans, jobs, answers under keys, recordings.

Triggers of the database count them in the transaction that stores, changes or deletes a row, so
that rows of processes of the previous version count as well, and nothing is summed when a plan is
stored. A row counts with its texts and data, and with ROW_BYTES for everything else of it.
"""

from sqlalchemy import Connection, LargeBinary, Table, Text, text

from api.problems import StorageFull
from api.storage.tables import METADATA

ROW_BYTES = 500
"""Bytes that a row counts with beside its texts and data: other columns, indexes, the queue's."""

_KEPT = text("SELECT kind, sum(bytes) FROM owner_bytes WHERE owner = :owner GROUP BY kind")


def bytes_kept(connection: Connection, owner: str) -> dict[str, int]:
    """Return the bytes that an owner keeps, by kind."""
    kept = {kind: int(size) for kind, size in connection.execute(_KEPT, {"owner": owner})}
    return {kind: kept.get(kind, 0) for kind in ("plans", "jobs", "answers", "recordings")}


def excess(connection: Connection, owner: str, most: int) -> StorageFull | None:
    """Return the problem that an owner keeps more bytes than `most`, if that is so."""
    kept = bytes_kept(connection, owner)
    if sum(kept.values()) <= most:
        return None
    shares = ", ".join(f"{kind} {size}" for kind, size in kept.items())
    return StorageFull(
        f"you would keep {sum(kept.values())} bytes ({shares}), the most allowed is {most} "
        "(SYNCPLAN_MAX_OWNER_BYTES); delete some, or wait until answers expire"
    )


def count_bytes(connection: Connection) -> None:
    """Let the database count bytes from now on, and count those that are there."""
    execute = connection.exec_driver_sql
    octets, slot, name_in = "length(CAST({0}.{1} AS BLOB))", "0", ""
    on_postgresql = connection.dialect.name == "postgresql"
    if on_postgresql:
        # sessions count in rows of their own: in the same, they would wait for each other
        octets, slot, name_in = "octet_length({0}.{1})", "pg_backend_pid() & 255", " ON {}"
        # nobody writes meanwhile; in the order in which transactions write them
        counted = ", ".join(name for name, table in METADATA.tables.items() if _texts(table))
        execute(f"LOCK TABLE {counted}")
    execute("DELETE FROM owner_bytes")

    def run_at(event: str, table: str, does: str) -> None:
        name = "_".join([table, *event.lower().split()[:2]])
        body = f"BEGIN {does} END"
        execute(f"DROP TRIGGER IF EXISTS {name}{name_in.format(table)}")
        if on_postgresql:
            function = f"FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql"
            execute(f"CREATE OR REPLACE {function} AS $$ BEGIN {does} RETURN OLD; END $$")
            body = f"EXECUTE FUNCTION {name}()"
        execute(f"CREATE TRIGGER {name} {event} ON {table} FOR EACH ROW {body}")

    cleared = ""
    for name, table in METADATA.tables.items():
        texts = _texts(table)
        if not texts:
            continue
        kind, owner = name, "{0}.owner"
        if "job_id" in table.c:
            kind, owner = "jobs", "(SELECT owner FROM jobs WHERE id = {0}.job_id)"
            cleared += f"DELETE FROM {name} WHERE job_id = OLD.id;"
        sizes = (f"coalesce({octets.format('{0}', column)}, 0)" for column in texts)
        add = (
            f"INSERT INTO owner_bytes SELECT {owner}, '{kind}', {slot}, "
            f"{{1}}({' + '.join(sizes)} + {ROW_BYTES}) {{2}} ON CONFLICT (owner, kind, slot) "
            "DO UPDATE SET bytes = owner_bytes.bytes + excluded.bytes;"
        )
        gain, loss = add.format("NEW", "", "WHERE true"), add.format("OLD", "-", "WHERE true")
        run_at("AFTER INSERT", name, gain)
        run_at("AFTER DELETE", name, loss)
        run_at(f"AFTER UPDATE OF {', '.join(texts)}", name, loss + gain)
        execute(add.format(name, "sum", f"FROM {name} GROUP BY 1"))
    # while the owner of the job is known
    run_at("BEFORE DELETE", "jobs", cleared)


def _texts(table: Table) -> list[str]:
    """Columns of a table that hold texts or data."""
    return [column.name for column in table.c if isinstance(column.type, Text | LargeBinary)]
