#!/bin/sh
# Install syncplan with its service, and what exports telemetry, at the versions that are locked,
# into a new virtual environment: install.sh SOURCE TARGET
set -eu
"${PYTHON:-python3}" -m venv "$2"
"$2/bin/pip" install --constraint "$1/requirements.lock" "$1[telemetry]"
