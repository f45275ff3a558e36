#!/bin/sh
# Prepare a Prefect server for aerocal; may be run again at any time (an upgrade, a changed prefect.yaml).
#
#   PREFECT_API_URL=http://HOST:4200/api deploy/init.sh
#
# Not needed with `aerocal serve`, which does all of it at its start. Order: migrate the database where its address
# is known (PREFECT_SERVER_DATABASE_CONNECTION_URL), wait for the server, make the work pool, register the
# deployments, make the automation that ends runs whose process has died.
set -eu
cd "$(dirname "$0")/.."

: "${PREFECT_API_URL:?is not set: the address of the server, with /api}"
pool=${AEROCAL_POOL:-aerocal}
patience_s=${AEROCAL_PATIENCE_S:-180}
export DO_NOT_TRACK=1 PREFECT_SERVER_ANALYTICS_ENABLED=false

if [ -n "${PREFECT_SERVER_DATABASE_CONNECTION_URL:-}" ]; then
    prefect server database upgrade --yes
fi

waited=0
until python -c 'import sys, urllib.request; urllib.request.urlopen(sys.argv[1], timeout=5)' \
    "$PREFECT_API_URL/health" 2>/dev/null; do
    if [ "$waited" -ge "$patience_s" ]; then
        echo "The server $PREFECT_API_URL does not answer after $waited s." >&2
        exit 1
    fi
    sleep 2
    waited=$((waited + 2))
done

prefect --no-prompt work-pool create "$pool" --type process --overwrite
prefect --no-prompt deploy --prefect-file deploy/prefect.yaml --all
echo "Ready: prefect worker start --pool $pool"
