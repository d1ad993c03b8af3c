#!/bin/sh
# Install syncplan with its service, and what exports telemetry, at the versions and with
# the hashes that are locked, into a new virtual environment: install.sh SOURCE TARGET
set -eu
"${PYTHON:-python3}" -m venv "$2"
"$2/bin/pip" install --require-hashes --requirement "$1/docker/service.lock"
# built by what is locked as well, which then has no more to do here
"$2/bin/pip" install --no-deps --no-build-isolation "$1"
"$2/bin/pip" uninstall --yes hatchling trove-classifiers
