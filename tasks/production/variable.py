"""The variable that names the records of production; apart from them, so that its name loads no database."""

#: Set by ``aerocal serve`` for its runner and what the runner starts.
RECORDS_VARIABLE = "AEROCAL_RECORDS"
