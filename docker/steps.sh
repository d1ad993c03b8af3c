#!/usr/bin/env bash
# Follow the Dockerfile's steps without a container: what it copies, installed as it installs it,
# run as it runs it, from an empty folder outside the checkout, as an unprivileged user if we are
# root. Prints what a plan over HTTP comes to.
#
#   docker/steps.sh [small] [large] [filters] [flights]
#
# Only kernels of these names are compiled; all of them, as in the image, if none is named.
set -euo pipefail
cd "$(dirname "$0")/.."

# in front of a command; not a function, which in the background would be a shell around it
unprivileged=()
[ "$(id -u)" != 0 ] || unprivileged=(setpriv --reuid=65534 --regid=65534 --clear-groups)

# an interpreter that the unprivileged user may run as well
for candidate in "${PYTHON:-python3}" /usr/bin/python3; do
    PYTHON=$(command -v "$candidate") || continue
    "${unprivileged[@]}" "$PYTHON" -c 'import sys, ensurepip; sys.exit(sys.version_info < (3, 11))' \
        2>/dev/null && break
    PYTHON=
done
[ -n "$PYTHON" ] || { echo "no Python 3.11 that user 65534 may run; set PYTHON" >&2; exit 1; }
export PYTHON

folder=$(mktemp -d)
server=
worker=
finish() {
    [ -z "$server" ] || kill -KILL "$server" 2>/dev/null || true
    [ -z "$worker" ] || kill -KILL "$worker" 2>/dev/null || true
    rm -rf "$folder"
}
trap finish EXIT
chmod 755 "$folder"

echo "steps: what the image is built from"
mkdir "$folder/source"
sed -n '/ AS build$/,/^FROM python:3.11-slim$/s/^COPY //p' Dockerfile | while read -r line; do
    # shellcheck disable=SC2086
    set -- $line
    [ "${*: -1}" = ./ ] || set -- "$1" "${*: -1}"
    for what in "${@:1:$#-1}"; do
        cp -r --parents -t "$folder/source" "$what"
    done
done
find "$folder/source" -name __pycache__ -prune -exec rm -rf {} +

echo "steps: install"
sh docker/install.sh "$folder/source" "$folder/syncplan" >"$folder/pip.log" 2>&1 ||
    { tail -n 20 "$folder/pip.log" >&2; exit 1; }
mkdir -p "$folder/syncplan/share"
cp docker/warm_up.py docker/healthcheck.py "$folder/syncplan/share"
rm -rf "$folder/source"

echo "steps: kernels"
mkdir -m 700 "$folder/cache" "$folder/data"
[ "$(id -u)" != 0 ] || chown 65534:65534 "$folder/cache" "$folder/data"
bin=$folder/syncplan/bin
export HOME=$folder/data NUMBA_CACHE_DIR=$folder/cache SYNCPLAN_DATA_DIR=$folder/data
free_port() {
    "$bin/python" -c 'import socket; print(socket.create_server(("127.0.0.1", 0)).getsockname()[1])'
}
# PROCESS LOG [PORT]: wait until it says that it is ready
await_ready() {
    for ((tries = 0; ; tries++)); do
        "${unprivileged[@]}" "$bin/python" "$folder/syncplan/share/healthcheck.py" "${@:3}" \
            2>/dev/null && break
        [ "$tries" -lt 60 ] && kill -0 "$1" 2>/dev/null ||
            { cat "$2" >&2; echo "it is not ready" >&2; exit 1; }
        sleep 0.5
    done
}
SYNCPLAN_PORT=$(free_port)
export SYNCPLAN_PORT SYNCPLAN_HOST=0.0.0.0
scenario=$PWD/examples/scenarios/paper-grid-same.yaml
further=$PWD/examples/scenarios/biased-grid.yaml
cd "$folder/data"
"${unprivileged[@]}" "$bin/python" "$folder/syncplan/share/warm_up.py" "$@"
[ -n "$(ls "$folder/cache")" ] || { echo "no kernels in the cache" >&2; exit 1; }

echo "steps: no keys, no service"
if refusal=$("${unprivileged[@]}" "$bin/syncplan" serve 2>&1); then
    echo "it listens to everybody without keys" >&2
    exit 1
fi
case $refusal in *SYNCPLAN_API_KEYS*) ;; *) echo "$refusal" >&2; exit 1 ;; esac

echo "steps: serve"
key=$("$bin/python" -c 'import secrets; print(secrets.token_hex(24))')
SYNCPLAN_API_KEYS=check:$key "${unprivileged[@]}" "$bin/syncplan" serve 2>"$folder/log" &
server=$!
await_ready "$server" "$folder/log"

echo "steps: plan"
"$bin/python" - "$key" "$scenario" <<'PYTHON'
import json
import os
import sys
from pathlib import Path
from urllib.request import ProxyHandler, Request, build_opener

key, scenario = sys.argv[1:]
service = f"http://127.0.0.1:{os.environ['SYNCPLAN_PORT']}"
address = f"{service}/v1/plans"
headers = {"Authorization": f"Bearer {key}", "Content-Type": "application/yaml"}
request = Request(address, Path(scenario).read_bytes(), headers)
with build_opener(ProxyHandler({})).open(request, timeout=30.0) as answer:
    plan = json.load(answer)
for vehicle in plan["vehicles"]:
    print(vehicle["name"], vehicle["phase_rad"], vehicle["position_m"])
assert len(plan["vehicles"]) == 6
assert plan["observability"]["observable"]
for asset in ("", "assets/main.js", "assets/plotly.min.js", "assets/examples/paper-grid-same.yaml"):
    with build_opener(ProxyHandler({})).open(f"{service}/{asset}", timeout=30.0) as answer:
        assert answer.status == 200, asset
PYTHON
"${unprivileged[@]}" "$bin/syncplan" plan - <"$scenario" | "$bin/python" -c \
    'import json, sys; assert len(json.load(sys.stdin)["vehicles"]) == 6'
for of in "$scenario" "$further"; do
    "${unprivileged[@]}" "$bin/syncplan" validate - --trials 16 <"$of" 2>"$folder/said" >/dev/null
    if grep -q compiling "$folder/said"; then
        echo "the kernels of the image are not used" >&2
        exit 1
    fi
done

echo "steps: worker"
# it starts only if the packages that export telemetry are there
worker_port=$(free_port)
SYNCPLAN_TELEMETRY=true SYNCPLAN_WORKER_PORT=$worker_port \
    "${unprivileged[@]}" "$bin/syncplan" worker 2>"$folder/worker-log" &
worker=$!
await_ready "$worker" "$folder/worker-log" "$worker_port"
kill -TERM "$worker"
wait "$worker" || { cat "$folder/worker-log" >&2; echo "the worker did not end well" >&2; exit 1; }
worker=

echo "steps: stop"
kill -TERM "$server"
wait "$server" || { cat "$folder/log" >&2; echo "it did not end in good order" >&2; exit 1; }
server=
# the database and the room it keeps for a full disk
[ "$(ls "$folder/data")" = $'syncplan.db\nsyncplan.db-reserve' ] ||
    { ls -A "$folder/data" >&2; echo "more than the database was left" >&2; exit 1; }
echo "steps: done"
