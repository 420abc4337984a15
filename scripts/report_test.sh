#!/usr/bin/env bash
# Tests the pages of `nerf train` and `nerf report` in a browser without network: every picture decodes, and nothing
# is wider than a phone. Fails where there is no Chromium; the tests of tests/command/report alone leave that out then.
# usage: scripts/report_test.sh
# environment: CHROME  the browser [default: chromium, chromium-browser, google-chrome or chrome on the path]
set -euo pipefail
cd "$(dirname "$0")/.."

NERF_REQUIRE_BROWSER=1 cargo test --locked --test command report::
