"""The Parquet contracts: columns of every table with type, unit and meaning, and its key; a file a subject.

The key is also the sort order. Names and meanings of published tables are a contract: they are extended,
never renamed. A number that does not exist is null, never zero or NaN. A new table is a `TableSchema` in the
file of its subject; users see it if `tasks.results.publish` names it.
"""
