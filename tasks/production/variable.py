"""Names of the environment variables of production, in a module of their own that loads no database."""

#: Set by ``aerocal serve`` for its runner and what the runner starts.
RECORDS_VARIABLE = "AEROCAL_RECORDS"
#: Set likewise: address of the production page, which serves the documents of runs.
OVERVIEW_VARIABLE = "AEROCAL_OVERVIEW_URL"
